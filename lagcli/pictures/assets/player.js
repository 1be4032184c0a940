"use strict";

/*
 * Player: a stage with play and pause, a time line, speed, loop, and arrows on and off.
 *
 * Needs instants.js, the stage's own scripts (scene.js and what it needs) and player.css.
 *
 *   const player = new Player(element, data, {label: "slider-crank", onTime: (t) => …});
 *   player.play(); player.pause();
 *   player.setTime(1.25);      // does not call onTime, so that two views can follow each other
 *   player.setScene(other);    // another run; time, speed, arrows and the view stay
 *
 * The clock and the numbers of arrows are those of the instant nearest to the time that is drawn, and
 * a motion that stands still stands at an instant; by default these are the times of the motion.
 *
 * Space, left and right act wherever nothing else takes them, while the player is seen. Keys within
 * it: space plays and pauses, left and right go back and on by
 * a frame, page up and down by a tenth, home and end to the ends; f is for arrows of force; in three
 * dimensions shift and an arrow key go around.
 *
 * The stage is a Scene on a canvas, or what `options.stage(element, data)` returns, which fills the
 * element: draw(time), setScene(data), `motion` with start and end, and the `target` that is labelled;
 * print(printing), and what else a Scene has, only if it is there. It may call its onSeek(time).
 */

class Player {
  static SPEEDS = [0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 100, 1000];
  static QUANTITIES = { force: "Forces", velocity: "Velocities", vector: "Vectors" };
  /** Longest time between two frames that is played, s: after a pause of the page it goes on there. */
  static LONGEST_FRAME = 0.1;
  static FRAME = 1 / 30;
  /** Keys that act on the whole page, and what takes them itself. */
  static ANYWHERE = [" ", "ArrowLeft", "ArrowRight"];
  static TAKEN = "input, select, textarea, button, summary, a, [tabindex], [contenteditable]";

  /**
   * @param {HTMLElement} element  becomes the player
   * @param {object} data  of the scene
   * @param {object} [options]
   * @param {string} [options.label]  what is moving, for screen readers
   * @param {number} [options.speed]  seconds of the motion per second
   * @param {boolean} [options.loop]
   * @param {boolean} [options.autoplay]  start by itself, unless the reader prefers reduced motion
   * @param {boolean} [options.forces]  whether arrows of force are shown at first
   * @param {number[]} [options.instants]  of all parts of the page
   * @param {function(number)} [options.onTime]  called when the player itself comes to another time
   * @param {function} [options.stage]
   */
  constructor(element, data, options = {}) {
    this.element = element;
    element.player = this; // to be found from the page
    this.label = options.label ?? "motion";
    this.onTime = options.onTime ?? (() => {});
    this.speed = options.speed ?? 1;
    this.loop = options.loop ?? true;
    this.playing = false;
    this.common = options.instants;
    this.#build(options.stage ?? Player.#canvas, data);
    if (options.forces === false) this.show("force", false);
    this.#take(data);
    this.#go(this.start);
    const still = matchMedia("(prefers-reduced-motion: reduce)");
    still.addEventListener("change", () => still.matches && this.pause());
    if (options.autoplay && !still.matches) this.play();
  }

  get start() {
    return this.stage.motion.start;
  }

  get end() {
    return this.stage.motion.end;
  }

  /** The times at which numbers are read. */
  get instants() {
    return this.common ?? this.stage.motion.time;
  }

  /** Take another run. */
  setScene(data) {
    this.stage.setScene(data);
    this.#take(data);
    this.#go(Math.min(this.time, this.end));
  }

  /** Go to a time, s, without calling onTime. */
  setTime(time) {
    this.#go(time);
  }

  play() {
    if (this.playing) return;
    if (this.time >= this.end) this.#go(this.start, true);
    this.playing = true;
    this.#showPlaying();
    let last = null;
    const frame = (now) => {
      if (!this.playing) return;
      const passed = last === null ? 0 : Math.min((now - last) / 1000, Player.LONGEST_FRAME);
      last = now;
      this.#advance(passed * this.speed);
      requestAnimationFrame(frame);
    };
    requestAnimationFrame(frame);
  }

  pause() {
    if (!this.playing) return;
    this.playing = false;
    this.#showPlaying();
    this.#go(this.read, true);
    this.#say();
  }

  /** Show the arrows of a quantity (force, velocity, vector), or not. */
  show(quantity, shown) {
    this.stage.show?.(quantity, shown);
    this.switches[quantity].setAttribute("aria-pressed", String(shown));
    this.#showVectors();
  }

  #advance(seconds) {
    const next = this.time + seconds;
    if (next < this.end) this.#go(next, true);
    else if (this.loop && this.end > this.start)
      this.#go(this.start + ((next - this.start) % (this.end - this.start)), true);
    else {
      this.#go(this.end, true);
      this.pause();
    }
  }

  #go(time, tell = false) {
    this.time = Math.max(this.start, Math.min(this.end, time));
    this.read = Instants.nearest(this.instants, this.time);
    this.stage.draw(this.time);
    this.line.value = String(this.time);
    const shown = this.#format(this.read);
    this.clock.textContent = shown;
    this.line.setAttribute("aria-valuetext", `${shown} of ${this.#format(this.end)}`);
    this.#showVectors();
    if (tell) this.onTime(this.time);
  }

  /** Go to a time on the reader's wish, and say it to who cannot see it. */
  #seek(time) {
    const wanted = Math.max(this.start, Math.min(this.end, time));
    this.pause();
    this.#go(Instants.step(this.instants, this.time, wanted), true);
    this.#say();
  }

  #say() {
    this.live.textContent = this.line.getAttribute("aria-valuetext");
  }

  #format(time) {
    return `${time.toFixed(this.digits)} s`;
  }

  #take(data) {
    const span = this.end - this.start;
    // a thousandth of the run, and one instant from the next, can be distinguished
    const parts = Math.max(1000 / Math.sqrt(10), this.instants.length - 1);
    this.digits = span > 0 ? Math.max(0, Math.min(9, Math.ceil(Math.log10(parts / span) - 1e-9))) : 2;
    [this.line.min, this.line.max] = [this.start, this.end].map(String);
    this.stage.target.setAttribute("aria-label", this.#describe(data));
    this.frame.classList.toggle("player-turns", data.dimension === 3);
    this.turn.hidden = data.dimension !== 3;
    this.vectors.replaceChildren();
    const found = this.#vectors();
    for (const { name, color } of found) {
      const item = document.createElement("li");
      item.dataset.name = name;
      item.style.setProperty("--key", color);
      this.vectors.append(item);
    }
    for (const [quantity, button] of Object.entries(this.switches))
      button.hidden = !found.some((vector) => vector.quantity === quantity);
  }

  #vectors() {
    return this.stage.vectors?.(this.read) ?? [];
  }

  /** Show the magnitudes of the vectors now. */
  #showVectors() {
    this.#vectors().forEach(({ name, quantity, unit, value }, i) => {
      const item = this.vectors.children[i];
      if (!item) return;
      // keeps its place, so that the stage keeps its size
      const shown = this.switches[quantity].getAttribute("aria-pressed") === "true";
      item.style.visibility = shown ? "visible" : "hidden";
      item.textContent = `${name} ${Player.#number(value)} ${unit}`.trimEnd();
    });
  }

  /** Return a magnitude with three digits, without an exponent where it reads better so. */
  static #number(value) {
    if (!Number.isFinite(value)) return "–";
    if (value === 0) return "0";
    const digits = value.toPrecision(3);
    return value >= 1000 && value < 1e6 ? String(Number(digits)) : digits;
  }

  #showPlaying() {
    const paths = { play: "M3 1 L14 8 L3 15 Z", pause: "M3 1 H6.5 V15 H3 Z M9.5 1 H13 V15 H9.5 Z" };
    this.toggle.setAttribute("aria-label", this.playing ? "Pause" : "Play");
    this.toggle.querySelector("path").setAttribute("d", this.playing ? paths.pause : paths.play);
  }

  /** Say what is on the canvas, in words. */
  #describe(data) {
    const names = [...new Set((data.shapes ?? []).filter((s) => s.kind === "label").map((s) => s.text))];
    const points = names.length ? ` Labelled points: ${names.join(", ")}.` : "";
    const turn = data.dimension === 3 ? " Drag, or shift and an arrow key, to turn it." : "";
    return `${this.stage.subject ?? "Animation"} of ${this.label}.${points}${turn}`;
  }

  static #canvas(element, data) {
    const canvas = document.createElement("canvas");
    element.append(canvas);
    return new Scene(canvas, data);
  }

  #build(stage, data) {
    const { element } = this;
    element.classList.add("player");
    element.setAttribute("role", "group");
    element.setAttribute("aria-label", `Player: ${this.label}`);
    element.innerHTML = `
      <div class="player-stage"></div>
      <div class="player-bar">
        <button type="button" class="player-toggle"><svg width="16" height="16" viewBox="0 0 16 16"
          aria-hidden="true"><path/></svg></button>
        <input type="range" step="any" aria-label="Time">
        <span class="player-time"></span>
      </div>
      <div class="player-bar">
        <label>Speed <select class="player-speed"></select></label>
        <button type="button" class="player-loop">Loop</button>
        <span class="player-switches"></span>
        <button type="button" class="player-turn">Reset view</button>
      </div>
      <ul class="player-vectors" aria-label="Arrows"></ul>
      <div class="player-hidden" role="status" aria-live="polite"></div>`;
    const find = (selector) => element.querySelector(selector);
    this.frame = find(".player-stage");
    this.toggle = find(".player-toggle");
    this.line = find("input");
    this.clock = find(".player-time");
    this.turn = find(".player-turn");
    this.vectors = find(".player-vectors");
    this.live = find("[aria-live]");
    this.stage = stage(this.frame, data);
    this.stage.onSeek = (time) => this.#seek(time);
    this.toggle.addEventListener("click", () => (this.playing ? this.pause() : this.play()));
    this.#showPlaying();
    this.line.addEventListener("input", () => this.#seek(Number(this.line.value)));
    this.#buildSpeeds(find(".player-speed"));
    this.#buildSwitches(find(".player-loop"), find(".player-switches"));
    this.turn.addEventListener("click", () => this.stage.resetView());
    element.addEventListener("keydown", (event) => this.#key(event));
    document.addEventListener("keydown", (event) => this.#keyAnywhere(event));
    addEventListener("beforeprint", () => this.#print(true));
    addEventListener("afterprint", () => this.#print(false));
  }

  /** Paper is light. */
  #print(printing) {
    this.element.classList.toggle("player-printing", printing);
    this.stage.restyle?.();
    this.stage.print?.(printing);
  }

  #buildSpeeds(select) {
    const speeds = [...new Set([...Player.SPEEDS, this.speed])].sort((a, b) => a - b);
    for (const speed of speeds) {
      const name = speed < 1 ? `1/${Number((1 / speed).toPrecision(4))}` : `${speed}`;
      select.add(new Option(speed === 1 ? "real time" : `× ${name}`, String(speed)));
    }
    select.value = String(this.speed);
    select.addEventListener("change", () => (this.speed = Number(select.value)));
  }

  #buildSwitches(loop, switches) {
    const pressed = (button) => button.getAttribute("aria-pressed") === "true";
    loop.setAttribute("aria-pressed", String(this.loop));
    loop.addEventListener("click", () => {
      this.loop = !this.loop;
      loop.setAttribute("aria-pressed", String(this.loop));
    });
    this.switches = {};
    for (const [quantity, name] of Object.entries(Player.QUANTITIES)) {
      const button = document.createElement("button");
      button.type = "button";
      button.textContent = name;
      button.dataset.quantity = quantity;
      button.setAttribute("aria-pressed", "true");
      button.addEventListener("click", () => this.show(quantity, !pressed(button)));
      this.switches[quantity] = button;
      switches.append(button);
    }
  }

  /** Keys of the page, where no field, button or part that scrolls has the focus. */
  #keyAnywhere(event) {
    if (event.defaultPrevented || event.shiftKey || !Player.ANYWHERE.includes(event.key)) return;
    if (event.target.closest?.(Player.TAKEN)) return;
    const { top, bottom, width } = this.frame.getBoundingClientRect();
    if (width && bottom > 0 && top < innerHeight) this.#key(event);
  }

  #key(event) {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const { key, target } = event;
    if (target.tagName === "SELECT") return; // its keys choose a speed
    if (key === " " && target.tagName === "BUTTON") return; // and this one presses the button
    const turns = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
    if (event.shiftKey && turns[key] && this.stage.dimension === 3) {
      this.stage.rotate(...turns[key].map((step) => (step * Math.PI) / 36));
      event.preventDefault();
      return;
    }
    const frame = Player.FRAME * this.speed;
    const tenth = (this.end - this.start) / 10;
    const steps = {
      ArrowLeft: -frame,
      ArrowDown: -frame,
      ArrowRight: frame,
      ArrowUp: frame,
      PageDown: -tenth,
      PageUp: tenth,
      Home: -Infinity,
      End: Infinity,
    };
    if (key in steps) this.#seek(this.time + steps[key]);
    else if (key === " ") this.playing ? this.pause() : this.play();
    else if (key === "f" && !this.switches.force.hidden) this.switches.force.click();
    else return;
    event.preventDefault();
  }
}
