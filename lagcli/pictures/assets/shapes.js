"use strict";

/*
 * Shapes: how each kind of shape of a scene looks.
 *
 * SHAPES[kind](shape, pen) returns the strokes of a shape now: {layer, depth, paint}. They are painted
 * layer by layer; in three dimensions BODIES are one layer, painted from the farthest to the nearest.
 * Lengths that do not belong to the mechanism (widths, heads of arrows) are in units of pen.unit.
 */

const LAYERS = (
  "guide wall belt ground trail plate disc edge slider spring damper rope rod joint flash vector label"
).split(" ");
const BODIES = new Set("trail plate disc edge slider spring damper rope rod joint".split(" "));
const BESIDE = 8; // of an arrow from the line along which it acts, in units
const ALONG = 0.25; // sine of the largest angle between them
const ON = 3; // units from a line within which an arrow begins on it

/** What the painting of shapes needs: canvas, motion, camera, colours, and sizes in pixels. */
class Pen {
  constructor(context, motion, camera, colors, unit) {
    Object.assign(this, { context, motion, camera, colors, unit });
  }

  /** Return where a point of the scene is on the canvas; null where it is nowhere. */
  place(point) {
    const at = this.camera.project(point);
    return at.every(Number.isFinite) ? at : null;
  }

  /** Return where a named point is. */
  at(name) {
    return this.place(this.motion.point(name));
  }

  path(places, closed = false) {
    const { context } = this;
    context.beginPath();
    places.forEach(([x, y], i) => (i ? context.lineTo(x, y) : context.moveTo(x, y)));
    if (closed) context.closePath();
  }

  line(places, color, width, { dash = [], alpha = 1, cap = "round" } = {}) {
    const { context } = this;
    context.save();
    context.globalAlpha = alpha * (this.fade ?? 1);
    context.strokeStyle = color;
    context.lineWidth = width * this.unit;
    context.lineCap = cap;
    context.lineJoin = "round";
    context.setLineDash(dash.map((length) => length * this.unit));
    this.path(places);
    context.stroke();
    context.restore();
  }

  area(places, color, alpha) {
    const { context } = this;
    context.save();
    context.globalAlpha = alpha * (this.fade ?? 1);
    context.fillStyle = color;
    this.path(places, true);
    context.fill();
    context.restore();
  }

  ring([x, y], radius, color, width, alpha) {
    const { context } = this;
    context.save();
    context.globalAlpha = alpha * (this.fade ?? 1);
    context.strokeStyle = color;
    context.lineWidth = width * this.unit;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.stroke();
    context.restore();
  }

  dot([x, y], radius, fill, edge) {
    const { context } = this;
    context.beginPath();
    context.arc(x, y, radius, 0, 2 * Math.PI);
    context.fillStyle = fill;
    context.fill();
    context.lineWidth = 1.6 * this.unit;
    context.strokeStyle = edge;
    context.stroke();
  }

  text(text, [x, y], color, align = "left", size = 13) {
    const { context } = this;
    context.font = `${size * Math.max(1, this.unit)}px system-ui, sans-serif`;
    context.textAlign = align;
    context.textBaseline = "middle";
    context.lineJoin = "round";
    context.lineWidth = 4;
    context.strokeStyle = this.colors.paper;
    context.strokeText(text, x, y);
    context.fillStyle = color;
    context.fillText(text, x, y);
  }
}

const middle = (a, b) => (a[2] + b[2]) / 2;

/** Return the ends of a shape on the canvas, or null where one of them is nowhere. */
function ends(shape, pen) {
  const [a, b] = [pen.at(shape.from), pen.at(shape.to)];
  return a && b ? [a, b] : null;
}

const SHAPES = {
  rod(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const paint = () => pen.line(found, pen.colors.rod, 5 * pen.slim);
    return [{ layer: "rod", depth: middle(...found), paint }];
  },

  rope(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const paint = () => pen.line(found, pen.colors.rod, 1.4);
    return [{ layer: "rope", depth: middle(...found), paint }];
  },

  /** A cylinder, open at one end, and its piston. */
  damper(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const [a, b] = found;
    const [along, across] = axes(a, b);
    const at = (forward, aside) =>
      [0, 1].map((i) => (a[i] + b[i]) / 2 + pen.unit * (forward * along[i] + aside * across[i]));
    const { spring } = pen.colors;
    const paint = () => {
      pen.line([a, at(-10, 0)], spring, 2, { cap: "butt" });
      pen.line([at(10, 7), at(-10, 7), at(-10, -7), at(10, -7)], spring, 2);
      pen.line([at(0, 5), at(0, -5)], spring, 2);
      pen.line([at(0, 0), b], spring, 2, { cap: "butt" });
    };
    return [{ layer: "damper", depth: middle(a, b), paint }];
  },

  /** A belt around two rollers, on whose upper run things lie. */
  belt(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const [along, across] = axes(...found);
    const radius = 8 * pen.unit;
    const hubs = found.map((end, k) =>
      [0, 1].map((i) => end[i] - radius * across[i] + (k ? -1 : 1) * radius * along[i]),
    );
    const half = Array.from({ length: 13 }, (_, k) => {
      const turn = Math.PI * (0.5 + k / 12);
      return [0, 1].map((i) => radius * (Math.cos(turn) * along[i] + Math.sin(turn) * across[i]));
    });
    const loop = [
      ...half.map((x) => [hubs[0][0] + x[0], hubs[0][1] + x[1]]),
      ...half.map((x) => [hubs[1][0] - x[0], hubs[1][1] - x[1]]),
    ];
    const { guide, ground, paper } = pen.colors;
    const paint = () => {
      pen.area(loop, guide, 0.18);
      pen.line([...loop, loop[0]], ground, 2);
      for (const hub of hubs) pen.dot(hub, 4.5 * pen.unit, paper, ground);
    };
    return [{ layer: "belt", depth: middle(...found), paint }];
  },

  /** A line that is hatched on its right. */
  wall(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const [a, b] = found;
    const [along, across] = axes(a, b);
    const step = 7 * pen.unit;
    const paint = () => {
      pen.line([a, b], pen.colors.ground, 1.8, { cap: "butt" });
      for (let s = step; s < Math.hypot(b[0] - a[0], b[1] - a[1]); s += step) {
        const foot = [0, 1].map((i) => a[i] + s * along[i]);
        pen.line([foot, foot.map((x, i) => x - step * (along[i] + across[i]))], pen.colors.ground, 1);
      }
    };
    return [{ layer: "wall", depth: middle(a, b), paint }];
  },

  /** A filled outline of a body. */
  plate(shape, pen) {
    const corners = shape.points.map((name) => pen.at(name));
    if (corners.includes(null)) return [];
    const depth = corners.reduce((sum, corner) => sum + corner[2], 0) / corners.length;
    const paint = () => {
      pen.area(corners, pen.colors.disc, 0.2);
      pen.line([...corners, corners[0]], pen.colors.disc, 1.8);
    };
    return [{ layer: "plate", depth, paint }];
  },

  /** A block along the nearest guide. */
  slider(shape, pen) {
    const at = pen.at(shape.at);
    if (!at) return [];
    let [nearest, along] = [Infinity, [1, 0]];
    for (const line of pen.segments) {
      const found = ["guide", "wall", "belt"].includes(line.kind) && ends(line, pen);
      const away = found ? fromLine(at, [...found[0].slice(0, 2), ...found[1].slice(0, 2)]) : Infinity;
      if (away < nearest) [nearest, along] = [away, axes(...found)[0]];
    }
    const corners = [
      [-1, -1],
      [1, -1],
      [1, 1],
      [-1, 1],
    ].map(([i, j]) => [
      at[0] + pen.unit * (13 * i * along[0] + 8 * j * along[1]),
      at[1] + pen.unit * (13 * i * along[1] - 8 * j * along[0]),
    ]);
    const paint = () => {
      pen.area(corners, pen.colors.paper, 1);
      pen.area(corners, pen.colors.disc, 0.3);
      pen.line([...corners, corners[0]], pen.colors.disc, 1.8);
    };
    return [{ layer: "slider", depth: at[2], paint }];
  },

  /** A mass: a filled dot. */
  mass(shape, pen) {
    return joint(shape.at, 6, pen.colors.point, pen);
  },

  /** A pin: a ring. */
  pin(shape, pen) {
    return joint(shape.at, 4.5, pen.colors.paper, pen);
  },

  /** A line of an outline. */
  edge(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const paint = () => pen.line(found, pen.colors.disc, 2);
    return [{ layer: "edge", depth: middle(...found), paint }];
  },

  /** A coil of as many turns at any length, between two straight ends. */
  spring(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const paint = () => pen.line(coil(found, 6 * pen.unit), pen.colors.spring, 2);
    return [{ layer: "spring", depth: middle(...found), paint }];
  },

  /** Rings around the places of impacts in the recent past, growing and fading. */
  flash({ times, at, strengths, life }, pen) {
    const rings = [];
    for (const [i, time] of Array.from(times).entries()) {
      const age = (pen.motion.now - time) / life;
      if (!(age >= 0 && age < 1)) continue;
      const place = pen.place(at.map((axis) => axis[i] ?? NaN));
      if (!place) continue;
      const size = 0.4 + 0.6 * Math.sqrt(strengths[i]);
      const radius = (8 + 16 * age) * size * pen.unit;
      const paint = () => pen.ring(place, radius, pen.colors.force, 3, 1 - age);
      rings.push({ layer: "flash", depth: place[2], paint });
    }
    return rings;
  },

  guide(shape, pen) {
    const found = ends(shape, pen);
    if (!found) return [];
    const paint = () => {
      pen.line(found, pen.colors.guide, 14, { alpha: 0.18, cap: "butt" });
      pen.line(found, pen.colors.guide, 1, { dash: [9, 4, 2, 4] });
    };
    return [{ layer: "guide", depth: middle(...found), paint }];
  },

  /** A bearing that stands on hatched ground. */
  ground(shape, pen) {
    const at = pen.at(shape.at);
    if (!at) return [];
    const paint = () => {
      const [x, y] = at;
      const [height, half] = [15 * pen.unit, 17 * pen.unit];
      const bearing = [
        [x, y],
        [x - 0.6 * half, y + height],
        [x + 0.6 * half, y + height],
      ];
      pen.area(bearing, pen.colors.paper, 1);
      pen.line([...bearing, bearing[0]], pen.colors.ground, 1.5);
      const foot = y + height;
      pen.line([[x - half, foot], [x + half, foot]], pen.colors.ground, 1.5);
      for (let i = -2; i <= 3; i++) {
        const right = x + (i * half) / 3;
        pen.line(
          [
            [right, foot],
            [right - half / 3, foot + half / 3],
          ],
          pen.colors.ground,
          1,
        );
      }
    };
    return [{ layer: "ground", depth: at[2], paint }];
  },

  /** A disc with a mark from its centre to its rim, which shows the angle. */
  disc(shape, pen) {
    const rim = rimOf(shape, pen);
    const places = Array.from({ length: 60 }, (_, i) => rim((i * Math.PI) / 30));
    const at = pen.at(shape.center);
    if (!at || places.includes(null)) return [];
    const mark = shape.angle ? rim(pen.motion.value(shape.angle)) : null;
    const paint = () => {
      pen.area(places, pen.colors.disc, 0.2);
      pen.line([...places, places[0]], pen.colors.disc, 2);
      if (mark) pen.line([at, mark], pen.colors.disc, 2.5);
    };
    return [{ layer: "disc", depth: at[2], paint }];
  },

  /** The path of a point in the recent past, fading: 30 % of the run, or `seconds` of the shape. */
  trail(shape, pen) {
    const { motion } = pen;
    const length = shape.seconds ?? (motion.end - motion.start) * 0.3;
    const path = motion.past(shape.of, length, 400).map(([time, point]) => [time, pen.place(point)]);
    const strokes = [];
    const pieces = 40; // of one shade each
    const step = Math.max(1, Math.ceil(path.length / pieces));
    for (let i = 0; i + 1 < path.length; i += step) {
      const piece = path.slice(i, i + step + 1);
      const places = piece.map(([, place]) => place);
      if (places.includes(null)) continue;
      const age = (motion.now - piece[piece.length - 1][0]) / length || 0;
      const paint = () =>
        pen.line(places, pen.colors.trail, 2.5, { alpha: 0.9 * (1 - age), cap: "butt" });
      strokes.push({ layer: "trail", depth: middle(places[0], places[places.length - 1]), paint });
    }
    return strokes;
  },

  vector(shape, pen) {
    const [a, b] = vectorEnds(shape, pen);
    if (!a || !b) return [];
    const { highlighted } = pen;
    const chosen = highlighted?.has(shape);
    const faint = Object.assign(Object.create(pen), { fade: highlighted && !chosen ? 0.25 : 1 });
    const color = pen.colorOf(shape);
    const paint = () => arrow(faint, a, b, color, chosen ? 1.8 : 1);
    return [{ layer: "vector", depth: middle(a, b), paint }];
  },

  label(shape, pen) {
    const at = pen.at(shape.at);
    if (!at) return [];
    const size = LABEL_SIZE * Math.max(1, pen.unit);
    const [width, height] = [0.62 * size * [...shape.text].length, size];
    const middle = labelPlace(at, width, height, pen.lines, pen.unit);
    const [left, right] = [middle[0] - width / 2, middle[0] + width / 2];
    pen.lines.push([left, middle[1], right, middle[1]]); // the next labels keep off this one
    const paint = () => pen.text(shape.text, middle, pen.colors.label, "center", LABEL_SIZE);
    return [{ layer: "label", depth: at[2], paint }];
  },
};

/** Return the strokes of a dot of a radius at a point: in front of the lines that end there. */
function joint(name, radius, fill, pen) {
  const at = pen.at(name);
  if (!at) return [];
  let depth = at[2];
  for (const { from, to } of pen.segments) {
    const other = from === name ? pen.at(to) : to === name ? pen.at(from) : null;
    if (other) depth = Math.min(depth, middle(at, other));
  }
  const paint = () => pen.dot(at, radius * pen.slim * pen.unit, fill, pen.colors.point);
  return [{ layer: "joint", depth, paint }];
}

/**
 * Return the ends of a vector on the canvas; null for one that is nowhere. A force along a line through
 * its point is drawn beside this line, which would hide it.
 */
function vectorEnds({ at, components, scale, quantity }, pen) {
  const from = pen.motion.point(at);
  const drawn = pen.motion.vector(components);
  const found = [from, from.map((c, i) => c + scale * drawn[i])].map((point) => pen.place(point));
  const [foot, tip] = found;
  if (quantity === "velocity" || !foot || !tip) return found;
  const way = [tip[0] - foot[0], tip[1] - foot[1]];
  const length = Math.hypot(...way);
  if (!length) return found;
  let side = [0, 0];
  for (const line of pen.segments) {
    const [a, b] = [pen.at(line.from), pen.at(line.to)];
    const size = a && b ? Math.hypot(b[0] - a[0], b[1] - a[1]) : 0;
    if (!size) continue;
    const [along, across] = axes(a, b);
    const on = (place, axis) => (place[0] - a[0]) * axis[0] + (place[1] - a[1]) * axis[1];
    const [begin, reach] = [on(foot, along), on(tip, along)];
    const overlap = Math.min(Math.max(begin, reach), size) - Math.max(Math.min(begin, reach), 0);
    const angle = Math.abs(across[0] * way[0] + across[1] * way[1]) / length;
    if (Math.abs(on(foot, across)) > ON * pen.unit || overlap <= 1 || angle >= ALONG) continue;
    const shift = (1 - angle / ALONG) * BESIDE * pen.unit;
    if (shift > Math.hypot(...side)) side = across.map((x) => shift * x);
  }
  return found.map(([x, y, depth]) => [x + side[0], y + side[1], depth]);
}

/** Return the unit vectors along a line on the canvas and to its left. */
function axes(a, b) {
  const [x, y] = [b[0] - a[0], b[1] - a[1]];
  const length = Math.hypot(x, y) || 1;
  return [
    [x / length, y / length],
    [y / length, -x / length],
  ];
}

/** Return the places along a spring, which is drawn in the plane of the canvas. */
function coil([a, b], radius, turns = 7) {
  const length = Math.hypot(b[0] - a[0], b[1] - a[1]) || 1;
  const [along, across] = axes(a, b);
  const lead = 0.15 * length;
  const count = turns * 16;
  const places = [a];
  for (let i = 0; i <= count; i++) {
    const phase = (2 * Math.PI * turns * i) / count;
    // seen a little from the side: the turns lean over
    const s = lead + ((length - 2 * lead) * i) / count + 0.4 * radius * (1 - Math.cos(phase));
    const d = radius * Math.sin(phase);
    places.push([a[0] + s * along[0] + d * across[0], a[1] + s * along[1] + d * across[1]]);
  }
  return [...places, b];
}

/** Return what gives the place on the rim of a disc at an angle, or null where it is nowhere. */
function rimOf(shape, pen) {
  const { motion } = pen;
  const centre = motion.point(shape.center);
  const radius = motion.value(shape.radius);
  const [first, second] = diameters(shape, motion, centre.length);
  const across = (angle, axis) => Math.cos(angle) * first[axis] + Math.sin(angle) * second[axis];
  return (angle) => pen.place(centre.map((c, axis) => c + radius * across(angle, axis)));
}

/** Return two unit vectors at right angles that span a disc; angles count from the first. */
function diameters(shape, motion, dimension) {
  if (dimension === 2)
    return [
      [1, 0],
      [0, 1],
    ];
  let normal = shape.normal ? motion.vector(shape.normal) : [0, 0, 1];
  const length = Math.hypot(...normal);
  normal = normal.map((c) => c / length);
  const [x, y, z] = normal;
  const level = Math.hypot(x, y);
  // the first is level, as the line of nodes of Euler's angles
  const first = level > 1e-9 ? [-y / level, x / level, 0] : [1, 0, 0];
  const second = [
    y * first[2] - z * first[1],
    z * first[0] - x * first[2],
    x * first[1] - y * first[0],
  ];
  return [first, second];
}

function arrow(pen, a, b, color, width = 1) {
  const [x, y] = [b[0] - a[0], b[1] - a[1]];
  const length = Math.hypot(x, y);
  if (length < 1.5) return;
  const head = Math.min(11 * pen.unit, 0.6 * length);
  const [dx, dy] = [x / length, y / length];
  const neck = [b[0] - head * dx, b[1] - head * dy];
  const half = 0.42 * head * width;
  pen.line([a, neck], color, 2.6 * width, { cap: "butt" });
  pen.area(
    [b, [neck[0] - half * dy, neck[1] + half * dx], [neck[0] + half * dy, neck[1] - half * dx]],
    color,
    1,
  );
}
