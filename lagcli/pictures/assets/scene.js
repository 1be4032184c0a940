"use strict";

/*
 * Scene: a mechanism drawn on a canvas, at any time.
 *
 * Needs camera.js, motion.js and shapes.js. The data is what lagcli/pictures/scene/scene.py describes.
 *
 *   const scene = new Scene(canvas, data);
 *   scene.draw(1.25);                     // at 1.25 s; between samples, interpolated
 *   scene.show("force", false);           // without the arrows of forces
 *   scene.setScene(other);                // another run, seen from where this one is
 *
 * The canvas is as large as its style says. `data.colors` may have the colours of constraints, by name;
 * the others follow the colour scheme of the page (see COLORS): custom properties of the canvas (--scene-rod, …) replace single ones.
 */

class Scene {
  static NEAR = 8; // CSS pixels between the pointer and an arrow that it points at
  /** Colours by scheme; the light ones are the ROLES of lagcli/pictures/style.py. */
  static COLORS = {
    light: {
      rod: "#404040",
      spring: "#009E73",
      guide: "#8C8C8C",
      ground: "#767676",
      disc: "#404040",
      point: "#202020",
      trail: "#56B4E9",
      label: "#202020",
      velocity: "#0072B2",
      force: "#D55E00",
      vector: "#CC79A7",
      paper: "#FFFFFF",
    },
    dark: {
      rod: "#B4BCC4",
      spring: "#2FC49A",
      guide: "#8C939B",
      ground: "#8C939B",
      disc: "#B4BCC4",
      point: "#ECECEC",
      trail: "#3F8FBF",
      label: "#ECECEC",
      velocity: "#58B7F5",
      force: "#FF8340",
      vector: "#E39CC5",
      paper: "#16191D",
    },
  };

  /**
   * @param {HTMLCanvasElement} canvas
   * @param {object} data
   */
  constructor(canvas, data) {
    this.canvas = this.target = canvas;
    canvas.setAttribute("role", "img");
    canvas.tabIndex = 0; // for the keys of whoever plays the scene
    this.context = canvas.getContext("2d");
    this.hidden = new Set();
    this.#readColors(); // a frame may have no size as yet
    this.setScene(data);
    new ResizeObserver(() => this.resize()).observe(canvas);
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => this.restyle());
    this.#dragToRotate();
    this.#tellPointed();
  }

  /** Take other data; the camera stays where it is, where the dimension is the same. */
  setScene(data) {
    const time = this.motion?.now;
    this.data = data;
    this.motion = new Motion(data);
    if (time !== undefined) this.motion.seek(time);
    if (this.camera && this.dimension === data.dimension) this.camera.setBounds(data.bounds, data.reach);
    else
      this.camera =
        data.dimension === 3 ? new OrbitCamera(data.bounds, data.reach) : new PlaneCamera(data.bounds);
    this.dimension = data.dimension;
    this.canvas.style.touchAction = this.dimension === 3 ? "none" : "auto";
    this.resize();
  }

  /** Draw the scene at a time, s. */
  draw(time) {
    this.motion.seek(time);
    this.#paint();
  }

  /** Show the vectors of a quantity (force, velocity, vector), or not. */
  show(quantity, shown) {
    if (shown) this.hidden.delete(quantity);
    else this.hidden.add(quantity);
    this.#paint();
  }

  /** Draw another run, in grey behind this one; null for none. */
  setGhost(data) {
    this.ghost = data && { shapes: data.shapes, motion: new Motion(data) };
    this.#paint();
  }

  /** Emphasize the arrows of the constraints for which a function of their names is true. */
  highlight(chosen) {
    this.chosen = chosen;
    this.#paint();
  }

  /** Return the colour of a vector: of the force of one constraint, that of the constraint. */
  colorOf({ parts, quantity }) {
    const own = parts?.length === 1 ? this.data.colors?.[parts[0]] : undefined;
    return own ?? this.colors[quantity] ?? this.colors.vector;
  }

  /** Return the vectors of the scene with their magnitude at a time: {name, quantity, unit, color, value}. */
  vectors(time = this.motion.now) {
    const vectors = this.data.shapes.filter((shape) => shape.kind === "vector");
    const { now } = this.motion;
    this.motion.seek(time);
    const found = vectors.map((shape) => {
      const { name, quantity, at, unit, components } = shape;
      const alike = vectors.filter((vector) => vector.name === name).length > 1;
      const value = Math.hypot(...this.motion.vector(components));
      return { name: alike ? `${name} at ${at}` : name, quantity, unit, color: this.colorOf(shape), value };
    });
    this.motion.seek(now);
    return found;
  }

  /** Return the ends of a vector on the canvas now, CSS pixels; null for one that is nowhere. */
  ends(vector) {
    return vectorEnds(vector, this.#pen());
  }

  /** Go around a scene of three dimensions, by angles in radians. */
  rotate(azimuth, elevation) {
    if (this.dimension !== 3) return;
    this.camera.rotate(azimuth, elevation);
    this.#paint();
  }

  /** See the scene from where it was first seen. */
  resetView() {
    if (this.dimension !== 3) return;
    this.camera.reset();
    this.#paint();
  }

  /** Read the colours of the page again, as after a change of theme. */
  restyle() {
    this.#readColors();
    this.#paint();
  }

  /** Take the size that the canvas has now. */
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    if (!width || !height) return; // not on the page yet
    const density = window.devicePixelRatio || 1;
    [this.canvas.width, this.canvas.height] = [width, height].map((c) => Math.round(c * density));
    this.context.setTransform(density, 0, 0, density, 0, 0);
    [this.width, this.height] = [width, height];
    this.camera.fit(width, height);
    this.restyle();
  }

  #readColors() {
    const style = getComputedStyle(this.canvas);
    const schemes = style.colorScheme.split(" ");
    const system = matchMedia("(prefers-color-scheme: dark)").matches;
    const dark = schemes.includes("dark") && (system || !schemes.includes("light"));
    this.colors = Object.fromEntries(
      Object.entries(Scene.COLORS[dark ? "dark" : "light"]).map(([name, usual]) => [
        name,
        style.getPropertyValue(`--scene-${name}`).trim() || usual,
      ]),
    );
  }

  /** Return a pen for this moment. */
  #pen() {
    const unit = Math.max(0.6, Math.min(1.6, Math.min(this.width, this.height) / 420));
    const pen = new Pen(this.context, this.motion, this.camera, this.colors, unit);
    // where rods are short, they and their joints are thinner than usual
    const lengths = this.data.shapes
      .filter((shape) => shape.kind === "rod")
      .map(({ from, to }) => {
        const [a, b] = [this.motion.point(from), this.motion.point(to)];
        return this.camera.scale * Math.hypot(...a.map((c, axis) => c - b[axis]));
      })
      .sort((a, b) => a - b);
    const middle = lengths[lengths.length >> 1] ?? Infinity;
    pen.slim = Math.max(0.45, Math.min(1, middle / (48 * unit)));
    pen.segments = this.data.shapes.filter(({ from }) => from);
    return pen;
  }

  #paint() {
    if (!this.width) return;
    this.context.clearRect(0, 0, this.width, this.height);
    const pen = this.#pen();
    if (this.dimension === 3) this.#paintFloor(pen);
    const shapes = this.data.shapes.filter(
      (shape) => shape.kind !== "vector" || !this.hidden.has(shape.quantity),
    );
    pen.lines = labelObstacles(shapes, pen);
    pen.colorOf = (shape) => this.colorOf(shape);
    const { chosen = () => false } = this;
    const lit = shapes.filter(({ parts }) => parts?.some(chosen));
    pen.highlighted = lit.length ? new Set(lit) : null;
    const strokes = shapes.flatMap((shape) => SHAPES[shape.kind](shape, pen));
    const solid = this.dimension === 3;
    const level = ({ layer }) => LAYERS.indexOf(solid && BODIES.has(layer) ? "rod" : layer);
    strokes.sort((a, b) => level(a) - level(b) || (solid ? b.depth - a.depth : 0));
    if (this.ghost) this.#paintGhost(pen);
    for (const { paint } of strokes) paint();
    if (this.dimension === 3) this.#paintTriad(pen);
    else this.#paintRule(pen);
  }

  #paintGhost({ unit, slim }) {
    const { shapes, motion } = this.ghost;
    motion.seek(Math.min(this.motion.now, motion.end));
    const grey = Object.fromEntries(Object.keys(this.colors).map((x) => [x, this.colors.ground]));
    const pen = new Pen(this.context, motion, this.camera, grey, unit);
    Object.assign(pen, { slim, fade: 0.45 });
    const bodies = ["rod", "rope", "spring", "damper", "disc", "edge", "plate"];
    for (const shape of shapes.filter(({ kind }) => bodies.includes(kind)))
      for (const { paint } of SHAPES[shape.kind](shape, pen)) paint();
  }

  /** A grid at the foot of the scene, without which depth is hard to see. */
  #paintFloor(pen) {
    const [xs, ys, [floor]] = this.data.bounds;
    const step = roundLength(Math.max(xs[1] - xs[0], ys[1] - ys[0]) / 5);
    if (!(step > 0)) return;
    const ticks = ([low, high]) => {
      const [first, last] = [Math.floor(low / step + 1e-6), Math.ceil(high / step - 1e-6)];
      return Array.from({ length: last - first + 1 }, (_, i) => (first + i) * step);
    };
    const [across, along] = [ticks(xs), ticks(ys)];
    const [left, right] = [across[0], across[across.length - 1]];
    const [front, back] = [along[0], along[along.length - 1]];
    const lines = [
      ...across.map((x) => [[x, front, floor], [x, back, floor]]),
      ...along.map((y) => [[left, y, floor], [right, y, floor]]),
    ];
    for (const line of lines)
      pen.line(
        line.map((point) => pen.place(point)),
        pen.colors.ground,
        1,
        { alpha: 0.3 },
      );
  }

  /** The directions of x, y and z, in a corner. */
  #paintTriad(pen) {
    const length = 26 * pen.unit;
    const [x, y] = [1.6 * length, this.height - 1.6 * length];
    for (const [axis, name] of ["x", "y", "z"].entries()) {
      const [right, up] = this.camera.components([0, 1, 2].map((i) => (i === axis ? 1 : 0)));
      const tip = (factor) => [x + factor * length * right, y - factor * length * up];
      arrow(pen, [x, y], tip(1), pen.colors.ground);
      pen.text(name, tip(1.35), pen.colors.ground, "center", 12);
    }
  }

  /** A length to measure by, in a corner. */
  #paintRule(pen) {
    const length = roundLength((0.2 * this.width) / this.camera.scale);
    const pixels = length * this.camera.scale;
    const [left, foot] = [14, this.height - 12];
    const tick = 4 * pen.unit;
    pen.line(
      [
        [left, foot - tick],
        [left, foot],
        [left + pixels, foot],
        [left + pixels, foot - tick],
      ],
      pen.colors.ground,
      1.2,
    );
    const unit = this.data.unit ? ` ${this.data.unit}` : "";
    const text = `${Number(length.toPrecision(1))}${unit}`;
    pen.text(text, [left + pixels / 2, foot - 11 * pen.unit], pen.colors.ground, "center", 11);
  }

  /** Call onPoint(constraints) when the pointer comes to the arrow of their force; with none after. */
  #tellPointed() {
    let last = null;
    const tell = (vector) => {
      if (vector !== last) this.onPoint?.(vector?.parts ?? []);
      last = vector;
    };
    this.canvas.addEventListener("pointermove", ({ buttons, offsetX, offsetY }) => {
      if (!buttons) tell(this.#forceAt([offsetX, offsetY]));
    });
    this.canvas.addEventListener("pointerleave", () => tell(null));
  }

  /** Return the arrow of a constraint force at a place on the canvas, or null. */
  #forceAt(place) {
    let [nearest, least] = [null, Scene.NEAR];
    for (const shape of this.data.shapes) {
      if (!shape.parts?.length || this.hidden.has(shape.quantity)) continue;
      const [a, b] = this.ends(shape);
      const away = a && b ? fromLine(place, [a[0], a[1], b[0], b[1]]) : Infinity;
      if (away < least) [nearest, least] = [shape, away];
    }
    return nearest;
  }

  #dragToRotate() {
    let last = null;
    const { canvas } = this;
    canvas.addEventListener("pointerdown", (event) => {
      if (this.dimension !== 3) return;
      last = [event.clientX, event.clientY];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!last) return;
      const [x, y] = [event.clientX - last[0], event.clientY - last[1]];
      last = [event.clientX, event.clientY];
      const perPixel = Math.PI / Math.min(this.width, this.height);
      this.rotate(-x * perPixel, y * perPixel);
    });
    for (const kind of ["pointerup", "pointercancel"])
      canvas.addEventListener(kind, () => (last = null));
  }
}

/** Return the largest of 1, 2, 5 times a power of ten that is no greater. */
function roundLength(length) {
  const power = 10 ** Math.floor(Math.log10(length));
  return (length >= 5 * power ? 5 : length >= 2 * power ? 2 : 1) * power;
}
