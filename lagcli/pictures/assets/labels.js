"use strict";

/*
 * Labels: where the text of a point stands, so that it hides no line. The same as
 * `label_place` in lagcli/pictures/scene/drawing.py.
 */

const LABEL_SIZE = 13;
const LABEL_AWAY = 10; // from its point: more than the radius of a body's dot
const rounded = (x) => Math.round(x * 1e9) / 1e9;

/** Return the lines on the canvas that labels keep off. */
function labelObstacles(shapes, pen) {
  const found = [];
  const add = (a, b) => a && b && found.push([a[0], a[1], b[0], b[1]]);
  for (const shape of shapes) {
    if (shape.from) add(pen.at(shape.from), pen.at(shape.to));
    else if (shape.kind === "ground") {
      const at = pen.at(shape.at);
      if (at) add(at, [at[0], at[1] + 20 * pen.unit]);
    } else if (shape.kind === "disc") {
      const rim = rimOf(shape, pen);
      const places = Array.from({ length: 25 }, (_, i) => rim((i * Math.PI) / 12));
      for (const [i, place] of places.entries()) if (i) add(places[i - 1], place);
    } else if (shape.kind === "vector") {
      add(...vectorEnds(shape, pen));
    }
  }
  return found;
}

/** Return the middle of a text of a size beside a point, where it is farthest from the lines. */
function labelPlace([x, y], width, height, lines, unit) {
  let best = null;
  for (let k = 0; k < 16; k++) {
    const angle = (k * Math.PI) / 8;
    const [right, down] = [Math.cos(angle), -Math.sin(angle)];
    // the nearest edge or corner of the text is as far from the point in all directions
    const beside = (way, size) => LABEL_AWAY * unit * way + (Math.sign(rounded(way)) * size) / 2;
    const middle = [x + beside(right, width), y + beside(down, height)];
    let clear = 10;
    for (const line of lines) {
      for (let i = 0; i < 9; i++) {
        const place = [
          middle[0] + (((i % 3) - 1) * width) / 2,
          middle[1] + ((Math.floor(i / 3) - 1) * height) / 2,
        ];
        clear = Math.min(clear, fromLine(place, line));
      }
    }
    // above and to the right, where it is as good
    const score = clear + 1.5 * Math.cos(angle - Math.PI / 4);
    if (!best || score > best.score + 1e-9) best = { score, middle };
  }
  return best.middle;
}

/** Return the distance of a point from a line between two ends. */
function fromLine([x, y], [ax, ay, bx, by]) {
  const [dx, dy] = [bx - ax, by - ay];
  const length = dx * dx + dy * dy;
  const part = length ? Math.max(0, Math.min(1, ((x - ax) * dx + (y - ay) * dy) / length)) : 0;
  return Math.hypot(x - ax - part * dx, y - ay - part * dy);
}
