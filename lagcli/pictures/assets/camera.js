"use strict";

/*
 * Cameras: where a point of a scene is on the canvas.
 *
 * Both have fit(width, height), which takes the size of the canvas in CSS pixels, and
 * project([x, y, z]), which returns [right, down, depth] in CSS pixels; what has the greater depth is
 * farther away. `scale` is the number of pixels per unit of length, in the middle of the scene.
 * place([right, down], depth) returns the point that is seen there.
 */

/** Two dimensions: x to the right, y up, both to one scale. */
class PlaneCamera {
  /** Left free at the foot, where the rule is, and at the top, CSS pixels. */
  static MARGIN = 26;

  /** @param {number[][]} bounds  [lowest, highest] of x and of y */
  constructor(bounds) {
    this.setBounds(bounds);
  }

  setBounds(bounds) {
    this.middle = bounds.map(([low, high]) => (low + high) / 2);
    this.span = bounds.map(([low, high]) => high - low);
  }

  fit(width, height) {
    const margin = PlaneCamera.MARGIN;
    const room = [width, height - 2 * margin];
    const scales = room.map((pixels, axis) => Math.max(pixels, 1) / this.span[axis]);
    this.scale = Math.min(...scales.filter(Number.isFinite));
    if (!Number.isFinite(this.scale)) this.scale = 1; // a scene of one point
    this.centre = [width / 2, height / 2];
  }

  project([x, y]) {
    return [
      this.centre[0] + (x - this.middle[0]) * this.scale,
      this.centre[1] - (y - this.middle[1]) * this.scale,
      0,
    ];
  }

  place([right, down]) {
    return [
      this.middle[0] + (right - this.centre[0]) / this.scale,
      this.middle[1] - (down - this.centre[1]) / this.scale,
    ];
  }
}

/** Three dimensions: z up, seen from a point that goes around the scene; a mild perspective. */
class OrbitCamera {
  static AZIMUTH = (-60 * Math.PI) / 180;
  static ELEVATION = (20 * Math.PI) / 180;
  /** Distance of the eye from the middle, in radii of the scene. */
  static DISTANCE = 6;

  /**
   * @param {number[][]} bounds  [lowest, highest] of x, y and z
   * @param {number} reach  the largest horizontal distance of anything from their middle
   */
  constructor(bounds, reach) {
    this.setBounds(bounds, reach);
    this.reset();
  }

  setBounds(bounds, reach) {
    this.middle = bounds.map(([low, high]) => (low + high) / 2);
    const [x, y, z] = bounds.map(([low, high]) => (high - low) / 2);
    [this.level, this.height] = [reach, z];
    this.radius = Math.hypot(x, y, z) || 1;
  }

  reset() {
    this.azimuth = OrbitCamera.AZIMUTH;
    this.elevation = OrbitCamera.ELEVATION;
    this.#turn();
  }

  /** Go around the scene by angles in radians. */
  rotate(azimuth, elevation) {
    this.azimuth = (this.azimuth + azimuth) % (2 * Math.PI);
    const limit = Math.PI / 2;
    this.elevation = Math.max(-limit, Math.min(limit, this.elevation + elevation));
    this.#turn();
  }

  #turn() {
    const [ca, sa] = [Math.cos(this.azimuth), Math.sin(this.azimuth)];
    const [ce, se] = [Math.cos(this.elevation), Math.sin(this.elevation)];
    this.right = [-sa, ca, 0];
    this.up = [-se * ca, -se * sa, ce];
    this.towards = [ce * ca, ce * sa, se]; // from the middle to the eye
    if (this.size) this.fit(...this.size);
  }

  fit(width, height) {
    this.size = [width, height];
    // whichever way the scene is turned about the vertical, all of it stays on the canvas
    const upright =
      this.level * Math.abs(Math.sin(this.elevation)) + this.height * Math.cos(this.elevation);
    const near = 1 + 1 / OrbitCamera.DISTANCE; // what is nearer than the middle looks larger
    const scale = Math.min(width / this.level, height / upright) / (2 * near);
    this.scale = Number.isFinite(scale) ? scale : Math.min(width, height) / 2;
    this.centre = [width / 2, height / 2];
  }

  /** Return the components of a direction along right, up and towards the eye. */
  components(direction) {
    const along = (axis) =>
      axis[0] * direction[0] + axis[1] * direction[1] + axis[2] * direction[2];
    return [along(this.right), along(this.up), along(this.towards)];
  }

  project(point) {
    const [right, up, near] = this.components(point.map((c, axis) => c - this.middle[axis]));
    const scale = this.#scaleAt(near);
    return [this.centre[0] + right * scale, this.centre[1] - up * scale, -near];
  }

  place([right, down], depth) {
    const scale = this.#scaleAt(-depth);
    const [across, up] = [(right - this.centre[0]) / scale, (this.centre[1] - down) / scale];
    return this.middle.map(
      (c, i) => c + across * this.right[i] + up * this.up[i] - depth * this.towards[i],
    );
  }

  /** The point from which the scene is seen. */
  get eye() {
    const distance = OrbitCamera.DISTANCE * this.radius;
    return this.middle.map((c, axis) => c + distance * this.towards[axis]);
  }

  /** Return the pixels per unit of length so much nearer than the middle. */
  #scaleAt(near) {
    const distance = OrbitCamera.DISTANCE * this.radius;
    return (this.scale * distance) / (distance - near);
  }
}
