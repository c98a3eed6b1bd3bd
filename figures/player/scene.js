// What is where in a scene, and why; see player.js, to whose module it belongs.

const DIGITS = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";

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
    // On which side of a vehicle the kerb is: 1 on the right, −1 on the left.
    const [{ in: [ux, uy], points: [x, y] }] = data.ways;
    this.kerb = uy * x - ux * y > 0 ? 1 : -1;
    // A vehicle gets the right of way, or a head turns: these are decisions.
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
