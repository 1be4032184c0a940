"use strict";

/*
 * Dragging: a body of the scene is grasped with the mouse or a finger and moved.
 *
 *   const dragging = new Dragging(frame, scene, {ask, moved, released, cancelled});
 *   dragging.points = ["A", "B"];        // that can be moved, as the program says
 *   dragging.answered(answer);           // to what was asked last
 *
 * One question is under way at a time: where the pointer is by the time of its answer is asked next.
 * In three dimensions the place that was grasped moves in the plane of the screen; elsewhere, dragging
 * turns the scene as before.
 */

class Dragging {
  static REACH = { mouse: 14, pen: 18, touch: 26 }; // of a point, CSS pixels
  static BESIDE = 0.6; // of that: how far from a rod
  static STILL = 3; // CSS pixels that a click may move

  /**
   * @param {HTMLElement} frame  around the canvas
   * @param {Scene} scene
   * @param {object} calls
   * @param {function(object)} calls.ask  with what DragRequest of lagcli/play/drags.py describes
   * @param {function()} calls.begun  the body leaves its place
   * @param {function(object)} calls.moved  with each answer
   * @param {function(Event)} calls.released
   * @param {function()} calls.cancelled
   */
  constructor(frame, scene, calls) {
    [this.frame, this.scene, this.calls] = [frame, scene, calls];
    this.points = [];
    this.gesture = 0;
    this.grip = null;
    this.ring = Row.text("div", "drag-ring", "");
    this.ring.hidden = true;
    frame.append(this.ring);
    const capture = { capture: true }; // before the scene turns
    frame.addEventListener("pointerdown", (event) => this.#grasp(event), capture);
    frame.addEventListener("pointermove", (event) => this.#move(event), capture);
    frame.addEventListener("pointerup", (event) => this.#release(event), capture);
    frame.addEventListener("pointercancel", () => this.cancel(), capture);
    frame.addEventListener("pointerleave", () => this.grip || this.#mark(null));
    // without this, a finger on a body would scroll the page
    frame.addEventListener(
      "touchstart",
      (event) => {
        const [touch] = event.changedTouches;
        if (this.grip || this.#find(touch, Dragging.REACH.touch)) event.preventDefault();
      },
      { ...capture, passive: false },
    );
    document.addEventListener("keydown", ({ key }) => key === "Escape" && this.cancel());
  }

  /** Whether a body is away from its place. */
  get active() {
    return this.grip?.moved ?? false;
  }

  /** Take the answer to what was asked last. */
  answered(answer) {
    const { grip } = this;
    if (!grip?.waiting || answer.gesture !== this.gesture) return; // cancelled
    grip.waiting = false;
    this.calls.moved(answer);
    this.#mark(grip.weights);
    if (grip.next) this.#ask(grip.next);
    else if (grip.released) this.#finish();
  }

  /** Put the body back. */
  cancel() {
    const { active } = this;
    this.#end();
    if (active) this.calls.cancelled();
  }

  /** Let go of the body where it is. */
  drop() {
    this.#end();
  }

  #place({ clientX, clientY }) {
    const { left, top } = this.scene.canvas.getBoundingClientRect();
    return [clientX - left, clientY - top];
  }

  #at(weights) {
    const points = Object.entries(weights).map(([name, weight]) =>
      this.scene.motion.point(name).map((c) => weight * c),
    );
    return points.reduce((sum, point) => sum.map((c, axis) => c + point[axis]));
  }

  #seen(weights) {
    return this.scene.camera.project(this.#at(weights));
  }

  /** Return the weights of what can be grasped at a place: a point, or a place on a rod or disc. */
  #find(event, reach) {
    const place = this.#place(event);
    const far = ([x, y]) => Math.hypot(x - place[0], y - place[1]);
    const nearest = (list) => list.reduce((a, b) => (b.far < (a?.far ?? Infinity) ? b : a), null);
    const held = (weights) => ({ weights, far: far(this.#seen(weights)) });
    const discs = this.scene.data.shapes.filter(({ kind }) => kind === "disc");
    const rims = new Set(discs.flatMap(Dragging.#rims));
    const own = this.points.filter((name) => !rims.has(name));
    const point = nearest(own.map((name) => held({ [name]: 1 })));
    if (point && point.far <= reach) return point.weights;
    const rods = this.scene.data.shapes.filter(
      ({ kind, from, to }) =>
        ["rod", "edge"].includes(kind) && [from, to].some((name) => this.points.includes(name)),
    );
    const rod = nearest(
      rods.map(({ from, to }) => {
        const [a, b] = [this.#seen({ [from]: 1 }), this.#seen({ [to]: 1 })];
        const along = [b[0] - a[0], b[1] - a[1]];
        const square = along[0] ** 2 + along[1] ** 2 || 1;
        const part = ((place[0] - a[0]) * along[0] + (place[1] - a[1]) * along[1]) / square;
        const inside = Math.max(0, Math.min(1, part));
        return held({ [from]: 1 - inside, [to]: inside });
      }),
    );
    if (rod && rod.far <= Dragging.BESIDE * reach) return rod.weights;
    const within = discs.find(
      (disc) =>
        [disc.center, ...Dragging.#rims(disc)].some((name) => this.points.includes(name)) &&
        far(this.#seen({ [disc.center]: 1 })) <=
          this.scene.motion.value(disc.radius) * this.scene.camera.scale,
    );
    return within ? this.#onDisc(within, place) : null;
  }

  /** The points on the rim of a disc that the program knows, if it turns in the plane. */
  static #rims({ name }) {
    return [`${name} rim 0`, `${name} rim 1`];
  }

  /** Return the weights of a place on a disc: its centre alone where it does not turn. */
  #onDisc(disc, place) {
    const rims = Dragging.#rims(disc);
    if (!(rims[0] in this.scene.data.points)) return { [disc.center]: 1 };
    const [centre, ...ends] = [disc.center, ...rims].map((name) => this.#seen({ [name]: 1 }));
    const [a, b] = ends.map(([x, y]) => {
      const [right, down] = [x - centre[0], y - centre[1]];
      const along = (place[0] - centre[0]) * right + (place[1] - centre[1]) * down;
      return along / (right ** 2 + down ** 2 || 1);
    });
    return { [disc.center]: 1 - a - b, [rims[0]]: a, [rims[1]]: b };
  }

  #grasp(event) {
    if (this.grip || event.button !== 0) return;
    const weights = this.#find(event, Dragging.REACH[event.pointerType] ?? Dragging.REACH.mouse);
    if (!weights) return;
    event.stopPropagation();
    this.frame.setPointerCapture(event.pointerId);
    const [place, seen] = [this.#place(event), this.#seen(weights)];
    this.grip = {
      pointer: event.pointerId,
      weights,
      place,
      offset: [seen[0] - place[0], seen[1] - place[1]],
      depth: seen[2],
      time: this.scene.motion.now,
      length: Math.max(...this.scene.data.bounds.map(([low, high]) => high - low)),
      moved: false,
      waiting: false,
      released: false,
      next: null,
    };
    this.gesture++;
    this.#mark(weights);
  }

  #move(event) {
    const { grip } = this;
    if (!grip) {
      if (event.buttons === 0 && event.pointerType !== "touch")
        this.#mark(this.#find(event, Dragging.REACH.mouse));
      return;
    }
    if (event.pointerId !== grip.pointer || grip.released) return;
    event.stopPropagation();
    const place = this.#place(event);
    if (!grip.moved) {
      const moved = Math.hypot(place[0] - grip.place[0], place[1] - grip.place[1]);
      if (moved < Dragging.STILL) return;
      grip.moved = true;
      this.calls.begun();
    }
    const target = place.map((c, axis) => c + grip.offset[axis]);
    if (grip.waiting) grip.next = target;
    else this.#ask(target);
  }

  #ask(target) {
    const { grip, scene } = this;
    [grip.waiting, grip.next] = [true, null];
    const { weights, time, length } = grip;
    this.calls.ask({
      gesture: this.gesture,
      time,
      weights,
      target: scene.camera.place(target, grip.depth),
      eye: scene.camera.eye ?? null,
      length,
    });
  }

  #release(event) {
    const { grip } = this;
    if (!grip || event.pointerId !== grip.pointer) return;
    event.stopPropagation();
    grip.released = true;
    grip.event = event;
    if (!grip.moved) this.#end();
    else if (!grip.waiting) this.#finish();
  }

  #finish() {
    const { event } = this.grip;
    this.#end();
    this.calls.released(event);
  }

  #end() {
    this.grip = null;
    this.#mark(null);
  }

  /** Show what is grasped, or can be. */
  #mark(weights) {
    this.ring.hidden = !weights;
    this.frame.classList.toggle("drag-possible", weights !== null);
    if (!weights) return;
    const [right, down] = this.#seen(weights);
    this.ring.style.transform = `translate(${right}px, ${down}px)`;
  }
}
