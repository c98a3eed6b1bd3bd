// One run in the player; see player.js, to whose module it belongs.

const SVG = "http://www.w3.org/2000/svg";
const BLINK = 0.8; // period of an indicator [s], of which it is on for
const LIT = 0.45;
const CRASH = 3; // how long a collision is ringed [s]
const HALF_STRIP = 20; // a time-space strip shows as many seconds before and after the moment
const DEEP = 100; // and so many metres before the hold line
const PAST = 20; // and after it
// The middle of the roof, and the arrow on it [m], as in figures/film/frames.py.
const ROOF = 0.68;
const ARROW = [[0.85, 0], [0.1, 0.75], [0.1, 0.25], [-0.8, 0.25], [-0.8, -0.25], [0.1, -0.25], [0.1, -0.75]];

/** One scene in a player: its picture, its sentence, its graph and its strip. */
class Pane {
  constructor(player, scene) {
    this.player = player;
    this.scene = scene;
    const data = scene.data;
    this.figure = player.make("figure", "pane");
    const caption = player.make("figcaption", "", this.figure);
    const name = player.make("b", "", caption);
    name.append(...player.words(data.controller));
    name.title = data.controller;
    this.counts = player.make("span", "counts", caption);
    this.count(10, 100, 10); // as wide as they become, for what is fitted before it is drawn
    this.counts.title = "in queues: vehicles in the picture that stand, or have moved up no faster than 10 km/h since; served: those that have left the junction since the start of the scene, without a collision";
    player.make("span", "what", caption).textContent = `${data.title} · ${data.demand} · profile ${data.profile} · seed ${data.seed}`;
    this.canvas = player.make("canvas", "junction", this.figure);
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `The junction under ${data.controller}, seen from above; click a vehicle to ask why it waits`);
    this.canvas.addEventListener("click", (event) => this.pick(event));
    this.panel = player.make("section", "report");
    this.name = player.make("h3", "", this.panel);
    this.name.append(...player.words(data.controller));
    this.why = player.make("p", "why", this.panel);
    this.why.setAttribute("aria-live", "polite");
    const row = player.make("div", "diagrams", this.panel);
    this.graph = document.createElementNS(SVG, "svg");
    this.graph.setAttribute("class", "graph");
    this.graph.setAttribute("role", "img");
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
    const stand = seen.filter((it) => it.stands).length, served = lastAt(scene.cleared, step, (it) => it) + 1;
    this.count(stand, served, scene.data.collisions.filter(([s]) => s <= step).length);
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

  count(stand, served, collisions) {
    const counts = [`in queues ${stand}`, `served ${served}`];
    if (this.scene.data.collisions.length) counts.unshift(`collisions ${collisions}`);
    this.player.write(this.counts, counts.join(" · "));
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
    const wide = pen.measureText(text).width + 10, away = r + 9;
    // Behind it, off the kerb, where no other vehicle and no signal is.
    const off = 0.8 * this.scene.kerb;
    const place = (middle, side, room, half) => Math.min(Math.max(middle + away * side, half), room - half);
    const left = place(x, off * car.uy - 0.6 * car.ux, pen.canvas.clientWidth, wide / 2) - wide / 2;
    const down = place(y, off * car.ux + 0.6 * car.uy, pen.canvas.clientHeight, 10);
    pen.fillStyle = colour;
    pen.fillRect(left, down - 10, wide, 20);
    pen.fillStyle = "#FFFFFF";
    pen.fillText(text, left + wide / 2, down + 1);
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
      else {
        const track = scene.tracks.find((it) => it.id === vehicle);
        text = `Vehicle ${vehicle} ${!track ? "is not in this scene" : this.step < track.from ? "is not there yet" : "has left the picture"}. N chooses the next.`;
      }
      const struck = scene.data.collisions.filter(([when, ...both]) => when <= this.step && both.includes(vehicle))
        .map(([, one, other]) => `vehicle ${one === vehicle ? other : one}`);
      if (struck.length) text = `It has collided with ${struck.join(" and ")}. ${text}`;
    }
    player.write(this.why, text);
  }

  /** The harmony graph: vehicles whose ways do not conflict are joined; those that go are filled. */
  drawGraph() {
    const { scene, player } = this, nodes = scene.participants(this.cars).slice(0, 12);
    const { clientWidth: width, clientHeight: height } = this.graph;
    const key = [player.chosen, width, height, ...nodes.map((it) => `${it.track.id}${it.goes}${it.stands}`)].join();
    if (key === this.graphKey) return;
    this.graphKey = key;
    const make = (tag, attributes, text) => {
      const element = document.createElementNS(SVG, tag);
      for (const [name, value] of Object.entries(attributes)) element.setAttribute(name, value);
      if (text !== undefined) element.textContent = text;
      this.graph.append(element);
    };
    this.graph.replaceChildren();
    // Nodes on an ellipse in pixels, as large as they can be without touching each other.
    this.graph.setAttribute("viewBox", `${-width / 2} ${-height / 2} ${width} ${height}`);
    const share = 0.7 * Math.sin(Math.PI / Math.max(nodes.length, 3));
    const r = Math.max(Math.min(0.5 * Math.min(width, height) * share / (1 + share), Math.max(30, 0.12 * Math.min(width, height))), 8);
    const [across, along] = [width, height].map((it) => Math.min(it / 2 - r - 3, 4 * r));
    const places = nodes.map((_, k) => {
      const angle = 2 * Math.PI * (k / Math.max(nodes.length, 1)) - Math.PI / 2;
      return nodes.length > 1 ? [across * Math.cos(angle), along * Math.sin(angle)] : [0, 0];
    });
    const [large, small] = [Math.max(0.72 * r, 11), Math.max(0.56 * r, 10)];
    this.graph.style.setProperty("--large", `${large}px`);
    this.graph.style.setProperty("--small", `${small}px`);
    const harmony = (a, b) => a.track.lane !== b.track.lane && !scene.ways[a.track.way].conflicts.includes(b.track.way);
    nodes.forEach((a, i) => nodes.slice(i + 1).forEach((b, j) => {
      if (!harmony(a, b)) return;
      const [[x1, y1], [x2, y2]] = [places[i], places[i + 1 + j]], both = a.goes && b.goes;
      make("line", { x1, y1, x2, y2, class: both ? "edge goes" : "edge" });
    }));
    nodes.forEach((it, k) => {
      const [cx, cy] = places[k], on = it.track.id === player.chosen;
      make("circle", { cx, cy, r, class: `node${it.goes ? " goes" : it.stands ? " stands" : ""}${on ? " chosen" : ""}` });
      make("text", { x: cx, y: cy - 0.06 * r, class: it.goes ? "goes" : "" }, scene.ways[it.track.way].name);
      make("text", { x: cx, y: cy + 0.64 * r, class: `small${it.goes ? " goes" : ""}` }, it.track.id);
    });
    if (!nodes.length) make("text", { x: 0, y: 0, class: "none" }, "no vehicle is near");
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
