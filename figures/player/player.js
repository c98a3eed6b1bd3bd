// The player of scenes, as one custom element; docs/scene.md tells what a scene holds.
//
//   element.show([scene, …])   one or two scenes on one clock, side by side
//   element.time               the time that is shown [s]; may be set
//   element.select(vehicle)    asks why this vehicle waits; null for none
//
// In a page, the scenes may stand inside the element as a script of the type application/json.
// With the attribute `fill`, it fills the height of its parent.
"use strict";

const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
const SVG = "http://www.w3.org/2000/svg";
const ICONS = {
  play: "M6 3l14 9-14 9z", pause: "M5 3h5v18H5zM14 3h5v18h-5z",
  back: "M4 4h3v16H4zM20 4v16L8 12z", on: "M17 4h3v16h-3zM4 4l12 8-12 8z",
};
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];
const BLINK = 0.8; // period of an indicator [s], of which it is on for
const LIT = 0.45;
const CRASH = 3; // how long a collision is ringed [s]
const HALF_STRIP = 20; // a time-space strip shows as many seconds before and after the moment
const DEEP = 100; // and so many metres before the hold line
const PAST = 20; // and after it
// The middle of the roof, and the arrow on it [m], as in figures/film/frames.py.
const ROOF = 0.68;
const ARROW = [[0.85, 0], [0.1, 0.75], [0.1, 0.25], [-0.8, 0.25], [-0.8, -0.25], [0.1, -0.25], [0.1, -0.75]];

function decoded(text) {
  const values = [];
  let number = 0, shift = 0;
  for (const character of text) {
    const digit = DIGITS.indexOf(character);
    number += (digit & 31) * 2 ** shift;
    shift += 5;
    if (!(digit & 32)) {
      values.push(number % 2 ? -(number - 1) / 2 : number / 2);
      number = shift = 0;
    }
  }
  return values;
}

function summedTwice(values) {
  const out = new Float64Array(values.length);
  let step = 0;
  values.forEach((value, k) => {
    if (k === 0) { out[0] = value; return; }
    step = k === 1 ? value : step + value;
    out[k] = out[k - 1] + step;
  });
  return out;
}

/** Index of the last of `items` whose `key` is not after `at`, or -1. */
function lastAt(items, at, key = (item) => item[0]) {
  let low = 0, high = items.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (key(items[middle]) <= at) low = middle + 1; else high = middle;
  }
  return low - 1;
}

/** A picture on a button, since fonts lack these signs. */
function icon(button, path) {
  const picture = document.createElementNS(SVG, "svg"), shape = document.createElementNS(SVG, "path");
  picture.setAttribute("viewBox", "0 0 24 24");
  shape.setAttribute("d", path);
  picture.append(shape);
  button.replaceChildren(picture);
}

/** A scene that is ready to be asked what is where at a step (not always a whole one). */
class Scene {
  constructor(data) {
    this.data = data;
    this.ground = data.ground;
    this.ways = data.ways;
    this.end = data.start + data.steps * data.step;
    this.angles = Object.fromEntries(
      Object.entries(data.headings).map(([key, text]) => [key, summedTwice(decoded(text))]));
    this.tracks = data.tracks.map((track) => {
      const s = summedTwice(decoded(track.s)).map((value) => value / 100);
      const states = [];
      for (let k = 0; k < track.states.length; k += 2) states.push([track.states[k], track.states[k + 1]]);
      return { ...track, s, states, to: track.from + s.length - 1, lane: this.ways[track.way].lane };
    });
    this.cleared = this.tracks
      .filter((it) => it.clear !== undefined && it.harmed === undefined)
      .map((it) => it.clear).sort((a, b) => a - b);
    this.heads = new Map();
    for (const [step, lane, state] of data.heads) {
      if (!this.heads.has(lane)) this.heads.set(lane, []);
      this.heads.get(lane).push([step, state]);
    }
    // Somebody gets the right of way, or a head turns: these are decisions.
    const decisions = new Set();
    for (const track of this.tracks)
      track.states.forEach(([step, state], k) => {
        if (k && state & 2 && !(track.states[k - 1][1] & 2)) decisions.add(step);
      });
    for (const [step] of data.heads) if (step) decisions.add(step);
    this.decisions = [...decisions].sort((a, b) => a - b);
  }

  step(time) {
    return Math.min(Math.max((time - this.data.start) / this.data.step, 0), this.data.steps);
  }

  at(step) {
    return this.tracks.filter((it) => it.from <= step && step <= it.to).map((track) => this.pose(track, step));
  }

  /** Where a vehicle is: `s` and front [m], unit heading, and its state. */
  pose(track, step) {
    const k = Math.min(Math.floor(step - track.from), track.s.length - 1);
    const next = Math.min(k + 1, track.s.length - 1);
    const s = track.s[k] + (step - track.from - k) * (track.s[next] - track.s[k]);
    const [x, y] = this.position(this.ways[track.way], s);
    const angle = this.heading(track, s);
    const type = this.data.types[track.type];
    const state = track.states[Math.max(lastAt(track.states, step + 1e-6), 0)][1];
    return { track, s, x, y, ux: Math.sin(angle), uy: Math.cos(angle), type, state, goes: !!(state & 2), stands: !!(state & 1) };
  }

  position(way, s) {
    const past = s - this.ground.entry, length = way.exit - this.ground.entry;
    const last = way.points.length / 2 - 1;
    const t = Math.min(Math.max(past / length, 0), 1) * last;
    const k = Math.min(Math.floor(t), last - 1), w = t - k, p = way.points;
    const before = Math.min(past, 0), after = Math.max(s - way.exit, 0);
    return [0, 1].map((i) => p[2 * k + i] * (1 - w) + p[2 * k + 2 + i] * w + before * way.in[i] + after * way.out[i]);
  }

  heading(track, s) {
    const way = this.ways[track.way], angles = this.angles[`${track.way} ${track.type}`];
    const length = way.exit - this.ground.entry, segments = way.points.length / 2 - 1;
    const t = Math.max((s - this.ground.entry) / length * segments, 0);
    if (t >= angles.length - 1) return Math.atan2(way.out[0], way.out[1]);
    const k = Math.floor(t);
    return (angles[k] + (t - k) * (angles[k + 1] - angles[k])) * Math.PI / 18000;
  }

  /** What is left of a way, as points, from `s` to its exit. */
  rest(way, s) {
    if (s >= way.exit) return [];
    const count = 32;
    return Array.from({ length: count + 1 }, (_, k) => this.position(way, s + (way.exit - s) * k / count));
  }

  headOf(lane, step) {
    const shown = this.heads.get(lane);
    return shown ? shown[Math.max(lastAt(shown, step + 1e-6), 0)][1] : null;
  }

  /** The reasons of a vehicle and, if it is behind another one, of those ahead. */
  why(vehicle, step) {
    const chain = [], seen = new Set();
    for (let me = vehicle; me !== undefined && !seen.has(me);) {
      seen.add(me);
      const told = this.data.reasons?.[me] ?? [];
      const k = lastAt(told, step + 1e-6);
      if (k < 0) break;
      const [, kind, sentence, others] = told[k];
      chain.push({ vehicle: me, kind, sentence, others });
      me = kind === "behind" ? others[0] : undefined;
    }
    return chain;
  }

  /** The vehicles that a decision is about: the first of each lane, and those that still go. */
  participants(cars) {
    const first = new Map();
    for (const car of cars) {
      const before = this.ground.entry - car.s, lane = car.track.lane;
      if (before >= 0 && before <= this.ground.sight && !(first.get(lane)?.s >= car.s)) first.set(lane, car);
    }
    const going = cars.filter((it) => it.goes && this.ground.entry - it.s <= this.ground.sight);
    return [...new Set([...first.values(), ...going])]
      .sort((a, b) => a.track.lane - b.track.lane || b.s - a.s);
  }
}

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

/** One scene in a player: its picture, its sentence, its graph and its strip. */
class Pane {
  constructor(player, scene) {
    this.player = player;
    this.scene = scene;
    const data = scene.data;
    this.figure = player.make("figure", "pane");
    const caption = player.make("figcaption", "", this.figure);
    const name = player.make("b", "", caption);
    name.textContent = name.title = data.controller;
    this.counts = player.make("span", "counts", caption);
    this.counts.title = "standing: vehicles in the picture that stand; served: those that have left the junction since the start of the scene, without a collision";
    player.make("span", "what", caption).textContent = `${data.title} · ${data.demand} · profile ${data.profile} · seed ${data.seed}`;
    this.canvas = player.make("canvas", "junction", this.figure);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `The junction under ${data.controller}, seen from above; click a vehicle to ask why it waits`);
    this.canvas.addEventListener("click", (event) => this.pick(event));
    this.panel = player.make("section", "report");
    this.name = player.make("h3", "", this.panel);
    this.name.textContent = data.controller;
    this.why = player.make("p", "why", this.panel);
    this.why.setAttribute("aria-live", "polite");
    const row = player.make("div", "diagrams", this.panel);
    this.graph = document.createElementNS(SVG, "svg");
    this.graph.setAttribute("class", "graph");
    this.graph.setAttribute("role", "img");
    this.graph.setAttribute("viewBox", "-105 -94 210 188");
    row.append(this.graph);
    this.strip = player.make("canvas", "strip", row);
    this.strip.setAttribute("role", "img");
    this.ground = document.createElement("canvas");
  }

  pick(event) {
    const box = this.canvas.getBoundingClientRect(), { reach } = this.player;
    const x = ((event.clientX - box.left) / box.width * 2 - 1) * reach;
    const y = (1 - (event.clientY - box.top) / box.height * 2) * reach;
    let best = null, least = Math.max(3, 14 * 2 * reach / box.width);
    for (const car of this.cars) {
      const along = Math.min(Math.max((car.x - x) * car.ux + (car.y - y) * car.uy, 0), car.type.length);
      const away = Math.hypot(car.x - along * car.ux - x, car.y - along * car.uy - y);
      if (away < least) { best = car; least = away; }
    }
    const arm = this.namePlaces().findIndex((at) => Math.hypot(at[0] - x, at[1] - y) < 3.5);
    if (!best && arm >= 0) this.player.lane = arm;
    this.player.select(best ? best.track.id : null);
    this.player.board.focus({ preventScroll: true });
  }

  draw(time) {
    const { scene, player } = this;
    const step = this.step = scene.step(time);
    this.cars = scene.at(step);
    const reach = player.reach;
    const { pen, width, height, ratio } = prepared(this.canvas);
    if (!width) return;
    if (this.ground.width !== this.canvas.width || this.ground.height !== this.canvas.height) this.paintGround(ratio);
    pen.drawImage(this.ground, 0, 0, width, height);
    const k = width / (2 * reach);
    const at = ([x, y]) => [width / 2 + k * x, height / 2 - k * y];
    const near = this.cars.filter((it) => Math.max(Math.abs(it.x), Math.abs(it.y)) <= 1.1 * reach);
    this.drawWays(pen, near, k, at);
    this.drawLines(pen, step, k, at);
    for (const car of near) this.drawCar(pen, car, time, k, at);
    this.chain = player.chosen === null ? [] : scene.why(player.chosen, step);
    this.drawReason(pen, k, at);
    this.drawCrashes(pen, step, k, at);
    this.drawNames(pen, k, at);
    const seen = near.filter((it) => Math.max(Math.abs(it.x), Math.abs(it.y)) <= reach);
    const counts = [`standing ${seen.filter((it) => it.stands).length}`, `served ${lastAt(scene.cleared, step, (it) => it) + 1}`];
    if (scene.data.collisions.length) counts.unshift(`collisions ${scene.data.collisions.filter(([s]) => s <= step).length}`);
    player.write(this.counts, counts.join(" · "));
    this.tell();
    this.drawGraph();
    this.drawStrip(time);
  }

  paintGround(ratio) {
    const { ground } = this.scene, look = (name) => this.player.look(name);
    const canvas = this.ground;
    canvas.width = this.canvas.width;
    canvas.height = this.canvas.height;
    const pen = canvas.getContext("2d"), k = canvas.width / (2 * this.player.reach);
    const at = ([x, y]) => [canvas.width / 2 + k * x, canvas.height / 2 - k * y];
    const shape = (flat) => trace(pen, pairs(flat).map(at), true);
    pen.fillStyle = look("grass");
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.lineJoin = "round";
    shape(ground.outline);
    pen.fillStyle = look("asphalt");
    pen.strokeStyle = "#9AA2AD";
    pen.lineWidth = ratio;
    pen.fill();
    pen.stroke();
    for (const zone of ground.zones) {
      const tile = hatch(zone.name, ratio);
      for (const strip of zone.strips) {
        shape(strip);
        pen.fillStyle = this.player.zone(zone.name);
        pen.fill();
        if (tile) { pen.fillStyle = pen.createPattern(tile, "repeat"); pen.fill(); }
      }
    }
    pen.strokeStyle = pen.fillStyle = "#FFFFFF";
    pen.lineWidth = 0.2 * k;
    pen.setLineDash([1.4 * k, 1.2 * k]);
    for (const line of ground.middles) { trace(pen, pairs(line).map(at)); pen.stroke(); }
    pen.setLineDash([]);
    for (const entry of ground.entries) { shape(entry); pen.fill(); }
  }

  drawWays(pen, cars, k, at) {
    const { scene } = this, { ground } = scene;
    pen.globalAlpha = 0.28;
    pen.strokeStyle = this.player.look("goes");
    pen.lineCap = "butt";
    for (const car of cars)
      if (car.goes && car.s > ground.entry - ground.sight) {
        pen.lineWidth = car.type.width * k;
        trace(pen, scene.rest(scene.ways[car.track.way], Math.max(ground.entry - Math.max(ground.hold, 1), car.s)).map(at));
        pen.stroke();
      }
    pen.globalAlpha = 1;
  }

  drawLines(pen, step, k, at) {
    const { scene, player } = this, first = new Map();
    for (const car of this.cars)
      if (car.s <= scene.ground.entry && !(first.get(car.track.lane)?.s >= car.s)) first.set(car.track.lane, car);
    scene.ground.holds.forEach((line, lane) => {
      if (!line) return;
      const state = scene.headOf(lane, step), ends = pairs(line);
      pen.strokeStyle = state ? player.look(`head-${state}`) : first.get(lane)?.goes ? player.look("goes") : player.look("ink");
      pen.lineWidth = k * (state === "green" ? 0.95 : state === "red" ? 0.3 : 0.55);
      trace(pen, ends.map(at));
      pen.stroke();
      if (!state) return;
      const [x, y] = at([0, 1].map((i) => ends[1][i] + 0.55 * (ends[1][i] - ends[0][i])));
      pen.fillStyle = player.look(`head-${state}`);
      pen.strokeStyle = player.look("ink");
      pen.lineWidth = 1;
      mark(pen, state, x, y, Math.max(0.9 * k, 4));
    });
  }

  drawCar(pen, car, time, k, at) {
    const { player } = this, { length, width } = car.type, half = width / 2;
    const place = ([along, across]) => at([car.x + along * car.ux - across * car.uy, car.y + along * car.uy + across * car.ux]);
    const nose = 0.45 * half, tail = 0.25 * half;
    const side = [[0, half - nose], [-nose, half], [tail - length, half], [-length, half - tail]];
    trace(pen, [...side, ...side.map(([x, y]) => [x, -y]).reverse()].map(place), true);
    pen.fillStyle = player.look(car.goes ? "goes" : car.stands ? "stands" : "moves");
    pen.strokeStyle = car.track.human ? player.look("ink") : "#FFFFFF";
    pen.lineWidth = car.track.human ? 2 : 1;
    pen.fill();
    pen.stroke();
    const [front, back] = [-0.26 * length, -0.4 * length];
    trace(pen, [[front, 0.72 * half], [front, -0.72 * half], [back, -0.62 * half], [back, 0.62 * half]].map(place), true);
    pen.fillStyle = "rgba(255, 255, 255, 0.82)";
    pen.fill();
    const way = this.scene.ways[car.track.way];
    if (car.s <= way.exit) {
      const to = way.to * Math.PI / 180, [x, y] = place([-ROOF * length, 0]);
      const [ux, uy] = [Math.sin(to), -Math.cos(to)], size = k * Math.min(1.15, width / 1.6);
      trace(pen, ARROW.map(([a, b]) => [x + size * (a * ux - b * uy), y + size * (a * uy + b * ux)]), true);
      pen.fillStyle = "#FFFFFF";
      pen.fill();
      if (way.turn && (player.still || time % BLINK < LIT))
        for (const behind of [0, length - 0.52]) {
          const across = -way.turn * half, size = 0.36;
          const lamp = [[0.1, -size], [0.1, size], [-2 * size, size], [-2 * size, -size]];
          trace(pen, lamp.map(([a, b]) => place([a - behind, b + across])), true);
          pen.fillStyle = "#FFB000";
          pen.strokeStyle = player.look("ink");
          pen.lineWidth = 0.7;
          pen.fill();
          pen.stroke();
        }
    }
    if (car.track.harmed <= this.step) {
      pen.strokeStyle = "#000000";
      pen.lineWidth = 2.4;
      for (const sign of [1, -1]) { trace(pen, [[0, sign * half], [-length, -sign * half]].map(place)); pen.stroke(); }
    }
  }

  /** The chosen vehicle, its way, the vehicles that it waits for, their ways, and where they meet. */
  drawReason(pen, k, at) {
    const { scene, player } = this, chosen = this.cars.find((it) => it.track.id === player.chosen);
    if (!chosen) return;
    const last = this.chain.at(-1), others = new Set(last?.others ?? []);
    const start = (car) => Math.max(car.s, scene.ground.entry - Math.max(scene.ground.hold, 1));
    const points = (car) => scene.rest(scene.ways[car.track.way], start(car));
    const speaker = this.cars.find((it) => it.track.id === last?.vehicle) ?? chosen;
    const mine = points(speaker);
    pen.lineCap = "round";
    const line = (path, colour, dash, width) => {
      trace(pen, path.map(at));
      pen.setLineDash([]);
      pen.strokeStyle = "#FFFFFF";
      pen.lineWidth = width + 3;
      pen.stroke();
      pen.setLineDash(dash);
      pen.strokeStyle = colour;
      pen.lineWidth = width;
      pen.stroke();
      pen.setLineDash([]);
    };
    const blockers = this.cars.filter((it) => others.has(it.track.id));
    for (const car of blockers) line(points(car), player.look("stands"), [7, 6], 2.5);
    line(mine, player.look("ink"), [], 3);
    for (const car of blockers) {
      const point = crossing(mine, points(car));
      if (point) {
        const [x, y] = at(point), r = Math.max(0.8 * k, 5);
        pen.lineWidth = 6;
        for (const colour of ["#FFFFFF", player.look("stands")]) {
          pen.strokeStyle = colour;
          for (const sign of [1, -1]) { trace(pen, [[x - r, y - sign * r], [x + r, y + sign * r]]); pen.stroke(); }
          pen.lineWidth = 3;
        }
      }
      this.ring(pen, car, k, at, player.look("stands"), true);
    }
    if (speaker !== chosen) this.ring(pen, speaker, k, at, player.look("ink"), true);
    this.ring(pen, chosen, k, at, player.look("ink"), false);
  }

  ring(pen, car, k, at, colour, dashed) {
    const half = car.type.length / 2, [x, y] = at([car.x - half * car.ux, car.y - half * car.uy]);
    const r = k * (half + 1.4);
    for (const [style, width] of [["#FFFFFF", 6], [colour, 3]]) {
      pen.beginPath();
      pen.setLineDash(dashed && style === colour ? [6, 4] : []);
      pen.arc(x, y, r, 0, 2 * Math.PI);
      pen.strokeStyle = style;
      pen.lineWidth = width;
      pen.stroke();
    }
    pen.setLineDash([]);
    const text = String(car.track.id);
    pen.font = "600 14px system-ui, sans-serif";
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const wide = pen.measureText(text).width + 10, room = pen.canvas.clientHeight - 12;
    const above = y - r - 9, below = y + r + 9; // on the side that is away from the junction
    const up = (car.y >= 0 ? above > 12 : below > room) ? above : below;
    pen.fillStyle = colour;
    pen.fillRect(x - wide / 2, up - 10, wide, 20);
    pen.fillStyle = "#FFFFFF";
    pen.fillText(text, x, up + 1);
  }

  drawCrashes(pen, step, k, at) {
    for (const [when, ...ids] of this.scene.data.collisions) {
      if (when > step || (step - when) * this.scene.data.step > CRASH) continue;
      const hit = this.cars.filter((it) => ids.includes(it.track.id));
      if (!hit.length) continue;
      const mean = (f) => hit.reduce((sum, it) => sum + f(it), 0) / hit.length;
      const [x, y] = at([mean((it) => it.x - it.ux * it.type.length / 2), mean((it) => it.y - it.uy * it.type.length / 2)]);
      pen.beginPath();
      pen.arc(x, y, 5 * k, 0, 2 * Math.PI);
      pen.strokeStyle = "#000000";
      pen.lineWidth = 4;
      pen.stroke();
    }
  }

  /** Where the names of the arms stand: at the edge of the picture, which may be of another scene. */
  namePlaces() {
    const scale = this.player.reach / this.scene.ground.reach;
    return this.scene.ground.arms.map((arm) => arm.at.map((value) => scale * value));
  }

  drawNames(pen, k, at) {
    const size = Math.max(11, Math.min(20, 1.9 * k));
    pen.font = `700 ${size}px system-ui, sans-serif`;
    pen.textAlign = "center";
    pen.textBaseline = "middle";
    const places = this.namePlaces();
    this.scene.ground.arms.forEach((arm, lane) => {
      const [x, y] = at(places[lane]);
      pen.beginPath();
      pen.arc(x, y, 0.85 * size, 0, 2 * Math.PI);
      pen.fillStyle = this.player.look("ink");
      pen.fill();
      if (lane === this.player.lane) { pen.strokeStyle = this.player.look("goes"); pen.lineWidth = 3; pen.stroke(); }
      pen.fillStyle = "#FFFFFF";
      pen.fillText(arm.name, x, y + 0.05 * size);
    });
  }

  /** Say why the chosen vehicle waits. */
  tell() {
    const { player, scene } = this, vehicle = player.chosen;
    let text = "Click a vehicle: it says why it waits or goes.";
    if (vehicle !== null) {
      const car = this.cars.find((it) => it.track.id === vehicle);
      const [first, last, between] = [this.chain[0], this.chain.at(-1), this.chain.length - 2];
      const more = between > 0 ? ` ${between === 1 ? "One more is" : `${between} more are`} ahead of that one, and at the front:` : "";
      if (first && car) text = first === last ? first.sentence : `${first.sentence}${more} ${last.sentence}`;
      else if (car) text = `Vehicle ${vehicle} is here. This scene has no reasons.`;
      else text = `Vehicle ${vehicle} is not in the scene at this time.`;
    }
    player.write(this.why, text);
  }

  /** The harmony graph: vehicles whose ways do not conflict are joined; those that go are filled. */
  drawGraph() {
    const { scene, player } = this, nodes = scene.participants(this.cars).slice(0, 12);
    const key = nodes.map((it) => `${it.track.id}${it.goes}`).join() + player.chosen;
    if (key === this.graphKey) return;
    this.graphKey = key;
    const make = (tag, attributes, text) => {
      const element = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      if (text !== undefined) element.textContent = text;
      this.graph.append(element);
    };
    this.graph.replaceChildren();
    const places = nodes.map((_, k) => {
      const angle = 2 * Math.PI * (k / Math.max(nodes.length, 1)) - Math.PI / 2;
      return nodes.length > 1 ? [78 * Math.cos(angle), 68 * Math.sin(angle)] : [0, 0];
    });
    const harmony = (a, b) => a.track.lane !== b.track.lane && !scene.ways[a.track.way].conflicts.includes(b.track.way);
    nodes.forEach((a, i) => nodes.slice(i + 1).forEach((b, j) => {
      if (!harmony(a, b)) return;
      const [[x1, y1], [x2, y2]] = [places[i], places[i + 1 + j]], both = a.goes && b.goes;
      make("line", { x1, y1, x2, y2, class: both ? "edge goes" : "edge" });
    }));
    nodes.forEach((it, k) => {
      const [cx, cy] = places[k], on = it.track.id === player.chosen;
      make("circle", { cx, cy, r: 23, class: `node${it.goes ? " goes" : ""}${on ? " chosen" : ""}` });
      make("text", { x: cx, y: cy - 1, class: it.goes ? "goes" : "" }, scene.ways[it.track.way].name);
      make("text", { x: cx, y: cy + 14, class: `small${it.goes ? " goes" : ""}` }, it.track.id);
    });
    if (!nodes.length) make("text", { x: 0, y: 0, class: "small" }, "no vehicle near the junction");
    const list = (some) => some.map((it) => `${scene.ways[it.track.way].name} (vehicle ${it.track.id})`).join(", ") || "none";
    this.graph.setAttribute("aria-label", `Harmony graph. Go: ${list(nodes.filter((it) => it.goes))}. Wait: ${list(nodes.filter((it) => !it.goes))}.`);
  }

  /** The time-space strip of the lane: where its vehicles are, some seconds before and after. */
  drawStrip(time) {
    const { scene, player } = this, { pen, width, height } = prepared(this.strip), { data, ground } = scene;
    if (!width) return;
    const lane = player.lane, stop = ground.entry - ground.hold;
    const em = Math.min(0.8 * parseFloat(getComputedStyle(this.strip).fontSize), 17);
    const [left, right, top, bottom] = [3 * em, width - 6, 1.6 * em, height - 1.6 * em];
    const x = (t) => left + (right - left) * (t - time + HALF_STRIP) / (2 * HALF_STRIP);
    const y = (s) => top + (bottom - top) * (stop + PAST - s) / (DEEP + PAST);
    pen.clearRect(0, 0, width, height);
    pen.font = `${em}px system-ui, sans-serif`;
    pen.fillStyle = player.look("muted");
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    for (const metres of [0, 50, 100]) pen.fillText(metres ? `−${metres}` : "0 m", left - 4, y(stop - metres));
    pen.textAlign = "left";
    pen.fillText(`lane ${ground.arms[lane].name}: distance [m]`, left, 0.7 * em);
    pen.textAlign = "center";
    const every = right - left < 14 * em ? 20 : 10;
    for (let t = Math.ceil((time - HALF_STRIP) / every) * every; t <= time + HALF_STRIP; t += every)
      if (x(t) > left + 14 && x(t) < right - 14) pen.fillText(`${t} s`, x(t), height - 0.7 * em);
    pen.save();
    pen.beginPath();
    pen.rect(left, top, right - left, bottom - top);
    pen.clip();
    pen.fillStyle = player.look("paper");
    pen.fillRect(left, top, right - left, bottom - top);
    this.drawStripHeads(pen, lane, x, y, stop, time);
    const [from, to] = [time - HALF_STRIP, time + HALF_STRIP].map((t) => scene.step(t));
    pen.lineJoin = "round";
    for (const track of scene.tracks) {
      if (track.lane !== lane || track.to < from || track.from > to) continue;
      const a = Math.max(Math.ceil(from), track.from), b = Math.min(Math.floor(to), track.to);
      const wide = track.id === player.chosen ? 3.5 : 1.5;
      track.states.forEach(([step, state], k) => {
        const [p, q] = [Math.max(a, step), Math.min(b, track.states[k + 1]?.[0] ?? track.to)];
        if (p > q) return;
        pen.beginPath();
        for (let n = p; n <= q; n += n + 3 < q ? 3 : Math.max(q - n, 1)) {
          const point = [x(data.start + n * data.step), y(track.s[n - track.from])];
          if (n === p) pen.moveTo(...point); else pen.lineTo(...point);
        }
        pen.strokeStyle = player.look(state & 2 ? "goes" : state & 1 ? "stands" : "moves");
        pen.lineWidth = wide;
        pen.stroke();
      });
    }
    pen.strokeStyle = player.look("ink");
    pen.lineWidth = 1.5;
    pen.setLineDash([3, 3]);
    trace(pen, [[x(time), top], [x(time), bottom]]);
    pen.stroke();
    pen.restore();
    pen.setLineDash([]);
    this.strip.setAttribute("aria-label", `Time-space strip of lane ${ground.arms[lane].name}`);
  }

  drawStripHeads(pen, lane, x, y, stop, time) {
    const { scene, player } = this, shown = scene.heads.get(lane) ?? [];
    const height = y(stop + (shown.length ? 2 : 0)); // heads are beside the first vehicle's line
    const line = (a, b, colour, width) => { trace(pen, [[a, height], [b, height]]); pen.strokeStyle = colour; pen.lineWidth = width; pen.stroke(); };
    if (!shown.length) line(x(time - HALF_STRIP), x(time + HALF_STRIP), player.look("ink"), 1.5);
    shown.forEach(([step, state], k) => {
      const until = shown[k + 1]?.[0] ?? scene.data.steps, at = (n) => x(scene.data.start + n * scene.data.step);
      line(at(step), at(until), player.look(`head-${state}`), state === "green" ? 6 : state === "amber" ? 4 : 2);
    });
  }
}

class Player extends HTMLElement {
  connectedCallback() {
    if (this.shadowRoot) { this.resized.observe(this); this.draw(); return; }
    this.attachShadow({ mode: "open" });
    const sheet = document.createElement("style");
    sheet.textContent = STYLE;
    this.shadowRoot.append(sheet);
    this.panes = [];
    this.chosen = null;
    this.lane = 0;
    this.speed = 1;
    this.playing = false;
    this.still = matchMedia("(prefers-reduced-motion: reduce)").matches;
    this.colours = new Map();
    this.build();
    this.resized = new ResizeObserver(() => this.fit());
    this.resized.observe(this);
    const inside = this.querySelector('script[type="application/json"]');
    if (inside) {
      this.show(JSON.parse(inside.textContent));
      if (!this.still && this.hasAttribute("autoplay")) this.play(true);
    }
  }

  disconnectedCallback() {
    this.play(false);
    this.resized.disconnect();
  }

  make(tag, name = "", parent = null) {
    const element = document.createElement(tag);
    if (name) element.className = name;
    parent?.append(element);
    return element;
  }

  /** A colour of the style sheet. */
  look(name) {
    if (!this.colours.has(name)) this.colours.set(name, getComputedStyle(this).getPropertyValue(`--${name}`).trim());
    return this.colours.get(name);
  }

  zone(name) {
    return this.look(`zone-${name}`) || this.look("other-zone");
  }

  write(element, text) {
    if (element.textContent !== text) element.textContent = text;
  }

  build() {
    const board = this.board = this.make("section", "board", this.shadowRoot);
    board.tabIndex = 0;
    board.setAttribute("aria-label", "Player. Space plays and pauses; arrows go one step, with Shift one decision; N takes the next vehicle.");
    const left = this.make("div", "left", board);
    this.stage = this.make("div", "stage", left);
    const controls = this.controls = this.make("div", "controls", left);
    const button = (name, label, action) => {
      const made = this.make("button", name, controls);
      made.type = "button";
      made.title = label;
      made.setAttribute("aria-label", label);
      made.addEventListener("click", (event) => {
        action();
        if (event.detail) board.focus({ preventScroll: true }); // after a click, keys are the player's
      });
      return made;
    };
    this.playButton = button("play", "play (Space)", () => this.play(!this.playing));
    icon(this.playButton, ICONS.play);
    icon(button("back", "previous decision (Shift ←)", () => this.decide(-1)), ICONS.back);
    icon(button("on", "next decision (Shift →)", () => this.decide(1)), ICONS.on);
    this.slider = this.make("input", "time", controls);
    this.slider.type = "range";
    this.slider.min = 0;
    this.slider.setAttribute("aria-label", "time");
    this.slider.addEventListener("input", () => { this.play(false); this.time = this.first + this.slider.value * this.unit; });
    this.clock = this.make("output", "clock", controls);
    this.rate = this.make("select", "speed", controls);
    this.rate.setAttribute("aria-label", "speed");
    for (const speed of SPEEDS) this.rate.add(new Option(`${speed < 1 ? (speed < 0.5 ? "¼" : "½") : speed}×`, speed, speed === 1, speed === 1));
    this.rate.addEventListener("change", () => { this.speed = Number(this.rate.value); });
    const panel = this.panel = this.make("div", "panel", board);
    const asks = this.make("div", "asks", panel);
    const asked = (label, input) => { const made = this.make("label", "", asks); made.textContent = `${label} `; made.append(input); return input; };
    this.number = asked("vehicle", document.createElement("input"));
    this.number.type = "number";
    this.number.min = 0;
    this.number.placeholder = "none";
    this.number.addEventListener("input", () => this.select(this.number.value === "" ? null : Number(this.number.value), true));
    this.lanes = asked("lane", document.createElement("select"));
    this.lanes.addEventListener("change", () => { this.lane = Number(this.lanes.value); this.draw(); });
    this.reports = this.make("div", "reports", panel);
    const legend = this.notes = this.make("details", "legend", panel);
    legend.open = true;
    this.make("summary", "", legend).textContent = "Legend";
    this.legend = this.make("ul", "", legend);
    board.addEventListener("keydown", (event) => this.key(event));
  }

  /** Show one scene or two; the time, the vehicle and the lane stay as they were if they can. */
  show(list) {
    const scenes = list.map((it) => new Scene(it));
    const before = this.panes.length ? this.time : null;
    this.panes = scenes.map((it) => new Pane(this, it));
    this.stage.replaceChildren(...this.panes.map((it) => it.figure));
    this.reports.replaceChildren(...this.panes.map((it) => it.panel));
    this.board.dataset.runs = scenes.length;
    this.reach = Math.max(...scenes.map((it) => it.ground.reach));
    this.first = Math.max(...scenes.map((it) => it.data.start));
    this.last = Math.min(...scenes.map((it) => it.end));
    this.unit = Math.min(...scenes.map((it) => it.data.step));
    this.slider.max = Math.round((this.last - this.first) / this.unit);
    const arms = scenes[0].ground.arms;
    this.lane = Math.min(this.lane, arms.length - 1);
    this.lanes.replaceChildren(...arms.map((arm, k) => new Option(arm.name, k, false, k === this.lane)));
    this.writeLegend();
    this.now = before !== null && before >= this.first && before <= this.last ? before : this.first;
    this.fit();
  }

  writeLegend() {
    const scenes = this.panes.map((it) => it.scene), some = (test) => scenes.some(test), rows = [];
    const row = (kind, colour, text, extra = "") => rows.push([kind, colour, text, extra]);
    row("body", "goes", "has the right of way; band: its way");
    row("body", "stands", "stands");
    row("body", "moves", "moves");
    row("arrow", "ink", "to its exit; lamps blink if it turns");
    if (some((it) => it.tracks.some((track) => track.human))) row("body outline", "moves", "dark outline: human driver");
    if (some((it) => it.data.collisions.length)) row("cross", "ink", "crossed out: has collided");
    if (some((it) => !it.heads.size)) {
      row("line", "ink", "hold line");
      row("line", "goes", "hold line whose first vehicle may go");
    }
    if (some((it) => it.heads.size))
      for (const [state, shape] of [["green", "●"], ["amber", "▲"], ["red", "■"]]) row("head", `head-${state}`, `signal: ${state}`, shape);
    const zones = new Map(scenes.flatMap((it) => it.ground.zones.map((zone) => [zone.name, zone.words])));
    for (const [name, words] of zones) row(`zone ${name}`, name, words);
    row("ring", "ink", "the chosen vehicle");
    row("ring dashed", "stands", "what it waits for, with its way");
    this.legend.replaceChildren(...rows.map(([kind, colour, text, extra]) => {
      const item = this.make("li"), swatch = this.make("i", kind, item);
      swatch.style.setProperty("--colour", kind.startsWith("zone") ? this.zone(colour) : this.look(colour));
      swatch.textContent = kind === "arrow" ? "↱" : kind === "cross" ? "✕" : extra;
      item.append(text);
      return item;
    }));
  }

  get time() {
    return this.now;
  }

  set time(value) {
    this.now = Math.min(Math.max(value, this.first), this.last);
    this.draw();
  }

  select(vehicle, typed = false) {
    this.chosen = vehicle;
    if (!typed) this.number.value = vehicle ?? "";
    const track = this.panes.flatMap((it) => it.scene.tracks).find((it) => it.id === vehicle);
    if (track) { this.lane = track.lane; this.lanes.value = track.lane; }
    this.draw();
  }

  play(on) {
    if (on && this.now >= this.last - 1e-6) this.now = this.first;
    this.playing = on && this.panes.length > 0;
    if (this.playButton) {
      icon(this.playButton, this.playing ? ICONS.pause : ICONS.play);
      const label = this.playing ? "pause (Space)" : "play (Space)";
      this.playButton.title = label;
      this.playButton.setAttribute("aria-label", label);
    }
    if (!this.playing || this.frame) return;
    let before = null;
    const tick = (now) => {
      this.frame = null;
      if (!this.playing) return;
      if (before !== null) this.time = this.now + (now - before) / 1000 * this.speed;
      before = now;
      if (this.now >= this.last) this.play(false);
      else this.frame = requestAnimationFrame(tick);
    };
    this.frame = requestAnimationFrame(tick);
  }

  /** Go to the next or previous decision: of the chosen vehicle, if there is one. */
  decide(way) {
    this.play(false);
    const times = this.panes.flatMap(({ scene }) => {
      const told = this.chosen === null ? null : scene.data.reasons?.[this.chosen]?.map((it) => it[0]);
      return (told ?? scene.decisions).map((step) => scene.data.start + step * scene.data.step);
    }).sort((a, b) => a - b);
    const next = way > 0 ? times.find((it) => it > this.now + 1e-6) : times.findLast((it) => it < this.now - 1e-6);
    if (next !== undefined) this.time = next;
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const on = event.composedPath()[0], key = event.key;
    const typing = on.tagName === "SELECT" || on.type === "number";
    if (typing && key !== "Escape") return;
    if (key === " ") {
      if (on.tagName === "BUTTON" || on.tagName === "SUMMARY") return; // it presses that one
      this.play(!this.playing);
    } else if (key === "ArrowRight" || key === "ArrowLeft") {
      const way = key === "ArrowRight" ? 1 : -1;
      if (event.shiftKey) this.decide(way);
      else { this.play(false); this.time = this.first + (Math.round((this.now - this.first) / this.unit) + way) * this.unit; }
    } else if (key === "Home") this.time = this.first;
    else if (key === "End") this.time = this.last;
    else if (key === "Escape") this.select(null);
    else if (key === "n" || key === "N") this.nextVehicle(event.shiftKey ? -1 : 1);
    else return;
    event.preventDefault();
  }

  nextVehicle(way) {
    const { reach } = this;
    const seen = this.panes[0].cars.filter((it) => Math.max(Math.abs(it.x), Math.abs(it.y)) <= reach).map((it) => it.track.id).sort((a, b) => a - b);
    if (!seen.length) return;
    const k = seen.indexOf(this.chosen);
    this.select(seen[(k < 0 ? (way > 0 ? 0 : seen.length - 1) : k + way + seen.length) % seen.length]);
  }

  /** Make the pictures as large as the place allows, with the controls in view. */
  fit() {
    if (!this.panes.length || !this.clientWidth) return;
    const narrow = this.clientWidth < 760, runs = this.panes.length;
    this.board.classList.toggle("narrow", narrow);
    const full = this.hasAttribute("fill") ? this.clientHeight : Math.min(0.85 * window.innerHeight, 720);
    const panel = runs > 1 ? Math.max(345, 0.275 * this.clientWidth) : 330;
    let side = 0, captions = [];
    for (let twice = 0; twice < 2; twice++) { // a caption may need more lines in a smaller picture
      captions = this.panes.map((it) => it.figure.firstChild.offsetHeight);
      const room = full - this.controls.offsetHeight - 26;
      side = Math.max(150, Math.floor(narrow
        ? Math.min(this.clientWidth - 16, (room - captions.reduce((a, b) => a + b, 0) - 6 * runs) / runs)
        : Math.min((this.clientWidth - panel - 10 * runs) / runs, room - Math.max(...captions))));
      this.style.setProperty("--side", `${side}px`);
    }
    this.style.setProperty("--full", `${Math.floor(full)}px`);
    const below = full - Math.max(...captions) - side - this.controls.offsetHeight - 40;
    const home = runs > 1 && !narrow && below > 110 ? this.controls.parentNode : this.panel;
    if (this.notes.parentNode !== home) home.append(this.notes);
    // A canvas is sharp if its edges are on whole pixels, so the graph beside it is as wide as some.
    const inner = this.reports.clientWidth - 24;
    this.style.setProperty("--graph", `${Math.min(320, narrow && inner < 430 ? inner : Math.floor(0.4 * inner))}px`);
    for (const pane of this.panes) pane.ground.width = 0;
    this.draw();
  }

  draw() {
    if (!this.panes.length) return;
    for (const pane of this.panes) pane.draw(this.now);
    this.slider.value = Math.round((this.now - this.first) / this.unit);
    this.slider.setAttribute("aria-valuetext", `${this.now.toFixed(1)} seconds`);
    this.write(this.clock, `${this.now.toFixed(1)} s`);
  }
}

if (!customElements.get("minisim-player")) customElements.define("minisim-player", Player);
