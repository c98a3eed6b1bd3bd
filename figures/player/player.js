// The player of scenes, as one custom element; docs/reference/scene.md tells what a scene holds.
//
//   element.show([scene, …])   one or two scenes on one clock, side by side
//   element.time               the time that is shown [s]; may be set
//   element.select(vehicle)    asks why this vehicle waits; null for none
//
// In a page, the scenes may stand inside the element as a script of the type application/json.
// With the attribute `fill`, it fills the height of its parent.
//
// It is one module of four files: scene.js, drawing.js, pane.js, and this one.

const ICONS = {
  play: "M6 3l14 9-14 9z", pause: "M5 3h5v18H5zM14 3h5v18h-5z",
  back: "M4 4h3v16H4zM20 4v16L8 12z", on: "M17 4h3v16h-3zM4 4l12 8-12 8z",
};
const SPEEDS = [0.25, 0.5, 1, 2, 4, 8];

/** A picture on a button, since fonts lack these signs. */
function icon(button, path) {
  const picture = document.createElementNS(SVG, "svg"), shape = document.createElementNS(SVG, "path");
  picture.setAttribute("viewBox", "0 0 24 24");
  shape.setAttribute("d", path);
  picture.append(shape);
  button.replaceChildren(picture);
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

  /** A text that may be broken after the signs in it, such as the name of a controller. */
  words(text) {
    return text.split(/(?<=[:=,])/).flatMap((part, k) => (k ? [document.createElement("wbr"), part] : [part]));
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
    this.lanes.addEventListener("change", () => this.draw());
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
    const lane = Math.min(Math.max(this.lane, 0), arms.length - 1);
    this.lanes.replaceChildren(...arms.map((arm, k) => new Option(arm.name, k)));
    this.lane = lane;
    this.writeLegend();
    this.now = before !== null && before >= this.first && before <= this.last ? before : this.first;
    this.fit();
  }

  writeLegend() {
    const scenes = this.panes.map((it) => it.scene), some = (test) => scenes.some(test), rows = [];
    const row = (kind, colour, text, extra = "") => rows.push([kind, colour, text, extra]);
    row("body", "goes", "may go; band: its way");
    row("body", "stands", "in a queue");
    row("body", "moves", "moves");
    row("arrow", "ink", "to its exit; lamps if it turns");
    if (some((it) => it.tracks.some((track) => track.human))) row("body outline", "moves", "dark outline: human driver");
    if (some((it) => it.data.collisions.length)) row("cross", "ink", "crossed out: has collided");
    if (some((it) => !it.heads.size)) {
      row("line", "ink", "hold line");
      row("line", "goes", "hold line: its first may go");
    }
    if (some((it) => it.heads.size))
      for (const [state, shape] of [["green", "●"], ["amber", "▲"], ["red", "■"]]) row("head", `head-${state}`, `signal: ${state}`, shape);
    const zones = new Map(scenes.flatMap((it) => it.ground.zones.map((zone) => [zone.name, zone.words])));
    for (const [name, words] of zones) row(`zone ${name}`, name, words);
    row("ring", "ink", "the chosen vehicle");
    row("ring dashed", "stands", "what it waits for; its way");
    this.legend.replaceChildren(...rows.map(([kind, colour, text, extra]) => {
      const item = this.make("li"), swatch = this.make("i", kind, item);
      swatch.style.setProperty("--colour", kind.startsWith("zone") ? this.zone(colour) : this.look(colour));
      swatch.textContent = kind === "arrow" ? "↱" : kind === "cross" ? "✕" : extra;
      item.append(text);
      return item;
    }));
  }

  /** The index of the lane whose strip is drawn. */
  get lane() {
    return this.lanes.selectedIndex;
  }

  set lane(index) {
    this.lanes.selectedIndex = index;
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
    if (track) this.lane = track.lane;
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
    const runs = this.panes.length, narrow = this.clientWidth < (runs > 1 ? 1000 : 760);
    const abreast = narrow && this.clientWidth >= 620 ? runs : 1;
    this.board.classList.toggle("narrow", narrow);
    this.board.classList.toggle("abreast", abreast > 1);
    const full = this.hasAttribute("fill") ? this.clientHeight : Math.min(0.85 * window.innerHeight, 720);
    const panel = runs > 1 ? Math.max(345, 0.275 * this.clientWidth) : 330;
    let side = 0, captions = [];
    for (let often = 0; often < 3; often++) { // a caption may need more lines in a smaller picture
      captions = this.panes.map((it) => it.figure.firstChild.offsetHeight);
      const room = full - this.controls.offsetHeight - 26;
      side = Math.max(150, Math.floor(narrow
        ? Math.min((this.clientWidth - 8) / abreast - 8, abreast > 1 ? room - Math.max(...captions)
          : (room - captions.reduce((a, b) => a + b, 0) - 6 * runs) / runs)
        : Math.min((this.clientWidth - panel - 10 * runs) / runs, room - Math.max(...captions))));
      this.style.setProperty("--side", `${side}px`);
    }
    this.style.setProperty("--full", `${Math.floor(full)}px`);
    const below = full - Math.max(...captions) - side - this.controls.offsetHeight - 40;
    const home = runs > 1 && !narrow && below > 110 ? this.controls.parentNode : this.panel;
    if (this.notes.parentNode !== home) home.append(this.notes);
    // A canvas is sharp if its edges are on whole pixels, so the graph beside it is as wide as some.
    const inner = (abreast > 1 ? (this.reports.clientWidth - 8) / 2 : this.reports.clientWidth) - 24;
    const alone = narrow && abreast === 1 && inner < 430;
    this.style.setProperty("--graph", `${Math.min(320, alone ? inner : Math.floor(0.4 * inner))}px`);
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
