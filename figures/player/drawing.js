// What the pictures are drawn with; see player.js, to whose module it belongs.

/** Where two polylines cross, or null. */
function crossing(one, other) {
  for (let i = 1; i < one.length; i++)
    for (let j = 1; j < other.length; j++) {
      const [a, b, c, d] = [one[i - 1], one[i], other[j - 1], other[j]];
      const ux = b[0] - a[0], uy = b[1] - a[1], vx = d[0] - c[0], vy = d[1] - c[1];
      const cross = ux * vy - uy * vx;
      if (Math.abs(cross) < 1e-9) continue;
      const s = ((c[0] - a[0]) * vy - (c[1] - a[1]) * vx) / cross;
      const t = ((c[0] - a[0]) * uy - (c[1] - a[1]) * ux) / cross;
      if (s >= 0 && s <= 1 && t >= 0 && t <= 1) return [a[0] + s * ux, a[1] + s * uy];
    }
  return null;
}

/** A canvas that is as sharp as its screen; drawn in CSS pixels. */
function prepared(canvas) {
  const ratio = window.devicePixelRatio || 1;
  const width = canvas.clientWidth, height = canvas.clientHeight;
  const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
  const pen = canvas.getContext("2d");
  pen.setTransform(ratio, 0, 0, ratio, 0, 0);
  return { pen, width, height, ratio };
}

function trace(pen, points, close = false) {
  pen.beginPath();
  points.forEach(([x, y], k) => (k ? pen.lineTo(x, y) : pen.moveTo(x, y)));
  if (close) pen.closePath();
}

function pairs(flat) {
  const points = [];
  for (let k = 0; k < flat.length; k += 2) points.push([flat[k], flat[k + 1]]);
  return points;
}

function mark(pen, state, x, y, r) {
  pen.beginPath();
  if (state === "green") pen.arc(x, y, r, 0, 2 * Math.PI);
  else if (state === "amber") { pen.moveTo(x, y - 1.2 * r); pen.lineTo(x + 1.15 * r, y + r); pen.lineTo(x - 1.15 * r, y + r); pen.closePath(); }
  else pen.rect(x - 0.9 * r, y - 0.9 * r, 1.8 * r, 1.8 * r);
  pen.fill();
  pen.stroke();
}

/** The strokes that tell zones apart without colour; null for none. */
function hatch(name, ratio) {
  if (name === "green") return null;
  const tile = document.createElement("canvas"), size = 8 * ratio;
  tile.width = tile.height = size;
  const pen = tile.getContext("2d");
  pen.strokeStyle = pen.fillStyle = "rgba(34, 39, 46, 0.38)";
  pen.lineWidth = 1.2 * ratio;
  if (name === "yellow") { pen.arc(size / 2, size / 2, 1.15 * ratio, 0, 2 * Math.PI); pen.fill(); return tile; }
  pen.beginPath();
  for (const shift of [-size, 0, size]) { pen.moveTo(shift, size); pen.lineTo(shift + size, 0); }
  pen.stroke();
  return tile;
}
