"use strict";

/*
 * Answers: what a page draws of a run of the core, in the form that the server of `lagcli play` has:
 * scene, plots, balance, events. `lagcli/live/content.py` says where the numbers of a sample are.
 *
 *   const answer = answerOf(content, run, {plots: ["energies"], balance: true});
 *
 * A run has `columns`, a Float64Array of each number of a sample, and `log`, its entries.
 */

/** Columns of a run, by their places; −1 is the energy balance. */
class Columns {
  constructor(content, columns) {
    [this.content, this.columns] = [content, columns];
    this.time = columns[0];
  }

  at(place) {
    return place < 0 ? (this.balance ??= this.#balance()) : this.columns[place];
  }

  /** Total energy minus its first value minus the work. */
  #balance() {
    const [energy, work] = [this.columns[this.content.places.energy_total], this.columns.at(-1)];
    return energy.map((e, i) => e - energy[0] - (work[i] - work[0]));
  }
}

/** The log of contacts and events: times, names and kinds, in order. */
class Happenings {
  static HEAD = 6; // time, kind, which, loss, supplied, work

  constructor({ log, names }, rows) {
    const { coordinates, constraints, events } = names;
    const [modes, nq] = [log.rows.length, coordinates.length];
    const rest = Happenings.HEAD + modes;
    const entries = rows.map((row, order) => {
      const kind = log.kinds[row[1]];
      const part = (first, count) => row.subarray(rest + first, rest + first + count);
      return {
        ...{ order, kind, time: row[0], loss: row[3], supplied: row[4], work: row[5] },
        name: kind === "event" ? events[row[2]] : constraints[row[2]],
        modes: row.subarray(Happenings.HEAD, rest),
        q: part(0, nq),
        before: part(nq, nq),
        after: part(2 * nq, nq),
        impulse: part(3 * nq, constraints.length),
      };
    });
    Happenings.#endRests(entries);
    this.entries = entries.sort((a, b) => a.time - b.time || a.order - b.order);
    let latest = 0; // entries that were moved have the modes of those before them
    for (const entry of this.entries) {
      latest = Math.max(latest, entry.order);
      entry.now = rows[latest].subarray(Happenings.HEAD, rest);
    }
    [this.rows, this.start] = [log.rows, log.start];
    this.times = [...new Set(this.entries.map(({ time }) => time))];
  }

  /** No contact is at rest later than at its next change. */
  static #endRests(entries) {
    const next = new Map();
    for (const entry of [...entries].reverse()) {
      if (entry.kind === "event") continue;
      if (entry.kind === "rest") entry.time = Math.min(entry.time, next.get(entry.name) ?? Infinity);
      next.set(entry.name, entry.time);
    }
  }

  /** Return, for increasing times, whether a row is open right after each. */
  open(name, times) {
    const row = this.rows.indexOf(name);
    let [i, mode] = [0, this.start[row]];
    return Array.from(times, (time) => {
      while (i < this.entries.length && this.entries[i].time <= time) mode = this.entries[i++].now[row];
      return mode === 0;
    });
  }

  /** Entries, counts and energies, for readers. */
  described(most) {
    const counts = new Map();
    for (const { name, kind } of this.entries) {
      const of = counts.get(name) ?? new Map();
      counts.set(name, of.set(kind, (of.get(kind) ?? 0) + 1));
    }
    const counted = [...counts].map(([name, of]) => `${name}: ${[...of].map(([kind, n]) => `${say(kind)} ${n}`).join(", ")}`);
    const sum = (what) => this.entries.reduce((total, entry) => total + entry[what], 0);
    const energies = [
      ["loss", say("impacts dissipated")],
      ["supplied", say("moving constraints supplied")],
      ["work", say("events did work")],
    ].flatMap(([what, text]) => (sum(what) ? [`${text} ${Number(sum(what).toPrecision(6))} J`] : []));
    const sentences = this.entries.length ? [counted.join("; ")] : [say("no changes of contacts, no events")];
    if (energies.length) sentences.push(energies.join(", "));
    const words = { impact: say("has an impact"), rest: say("comes to rest") };
    return {
      sentences,
      entries: this.entries.slice(0, most).map(({ time, name, kind }) => ({
        time,
        text: kind === "event" ? name : `${name} ${words[kind] ?? say(kind)}`,
      })),
      more: Math.max(0, this.entries.length - most),
    };
  }
}

/** Curves with their values right before and after each instant of a log; others as they are. */
class Sides {
  static SIDED = /^(.*_ddot|lambda\..*|Qc\..*|power_.*)$/;
  static ENERGIES = { energy_total: 1, energy_kinetic: 1, energy_potential: 0 };
  static BESIDE = 3; // samples from which a curve is continued

  constructor({ names }, time, happenings) {
    [this.time, this.names] = [time, names];
    const last = time[time.length - 1];
    this.instants = (happenings?.times ?? []).filter((t) => t >= time[0] && t <= last);
    this.entries = happenings?.entries ?? [];
    // a sample at an instant has the value after it
    this.places = this.instants.map((t) => Sides.#first(time, t));
  }

  /** The first index whose time is not before t. */
  static #first(times, t) {
    let [low, high] = [0, times.length];
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] < t) low = middle + 1;
      else high = middle;
    }
    return low;
  }

  /** Return the times with each instant twice. */
  times() {
    return this.#inserted(this.time, this.instants.map((t) => [t, t]));
  }

  /** Return a curve at these times. */
  values(name, values, jumps) {
    if (!this.instants.length) return values;
    return this.#inserted(values, this.#limits(name, values, jumps));
  }

  #inserted(values, pairs) {
    const found = new Float64Array(values.length + 2 * pairs.length);
    let [from, to] = [0, 0];
    pairs.forEach((pair, k) => {
      const part = values.subarray(from, this.places[k]);
      found.set(part, to);
      found.set(pair, to + part.length);
      [from, to] = [this.places[k], to + part.length + 2];
    });
    found.set(values.subarray(from), to);
    return found;
  }

  #limits(name, values, jumps) {
    const { coordinates } = this.names;
    const at = (t) => this.entries.filter(({ time }) => time === t);
    const moving = coordinates.indexOf(name.replace(/_dot$/, ""));
    if (coordinates.includes(name)) return this.instants.map((t) => [at(t)[0].q[moving], at(t).at(-1).q[moving]]);
    if (moving >= 0 && name.endsWith("_dot")) return this.instants.map((t) => [at(t)[0].before[moving], at(t).at(-1).after[moving]]);
    if (name in Sides.ENERGIES) return this.#energies(name, values);
    if (!jumps && !Sides.SIDED.test(name)) return this.instants.map((t, k) => Array(2).fill(this.#between(values, t, this.places[k])));
    return this.instants.map((t, k) => {
      const place = this.places[k];
      const held = values[Math.max(place - 1, 0)];
      const shared = (other) => this.places[other] === place; // of several instants between two samples, it jumps at the last one
      const left = shared(k - 1) || shared(k + 1) ? held : this.#continued(values, t, place - 1, -1, this.instants[k - 1]);
      return [left, shared(k + 1) ? held : this.#continued(values, t, place, 1, this.instants[k + 1])];
    });
  }

  #between(values, t, place) {
    const [i, j] = [Math.max(0, place - 1), Math.min(values.length - 1, place)];
    const span = this.time[j] - this.time[i];
    return span > 0 ? values[i] + ((t - this.time[i]) / span) * (values[j] - values[i]) : values[j];
  }

  /** Extrapolate a curve from the samples on one side, up to the other instant there. */
  #continued(values, t, nearest, away, other) {
    const end = values.length - 1;
    const places = [0, 1, 2].map((i) => Math.max(0, Math.min(end, nearest + away * i)));
    const [t0, t1, t2] = places.map((i) => this.time[i]);
    const [y0, y1, y2] = places.map((i) => values[i]);
    const within = (at, nearer) => at !== nearer && (other === undefined || (away < 0 ? at >= other : at < other));
    if (!within(t1, t0)) return y0;
    const slope = (y0 - y1) / (t0 - t1);
    const bent = within(t2, t1) ? 2 * slope - (y1 - y2) / (t1 - t2) : slope;
    const least = Math.abs(bent) < Math.abs(slope) ? bent : slope;
    const found = y0 - away * least * Math.min(Math.abs(t - t0), Math.abs(t0 - t1));
    return slope * bent > 0 && Number.isFinite(found) ? found : y0;
  }

  /** Energies jump by what impacts and events do: impacts change T, events T if velocities change, else V. */
  #energies(name, values) {
    const change = (entry) => {
      const moved = entry.before.some((v, i) => v !== entry.after[i]);
      const impacts = entry.supplied - entry.loss;
      if (name === "energy_total") return impacts + entry.work;
      if (name === "energy_kinetic") return impacts + (moved ? entry.work : 0);
      return moved ? 0 : entry.work;
    };
    const sums = [0];
    for (const entry of this.entries) sums.push(sums.at(-1) + change(entry));
    const until = (t, after) => {
      const count = this.entries.findIndex(({ time }) => (after ? time > t : time >= t));
      return sums[count < 0 ? this.entries.length : count];
    };
    const smooth = values.map((value, i) => value - until(this.time[i], true));
    return this.instants.map((t, k) => {
      const rest = this.#between(smooth, t, this.places[k]);
      return [rest + until(t, false), rest + until(t, true)];
    });
  }
}

/** Return the largest magnitude of the finite values. */
function largestOf(values) {
  let largest = 0;
  for (const value of values) if (Math.abs(value) > largest && Number.isFinite(value)) largest = Math.abs(value);
  return largest;
}

/** Return the panel of each curve: those of one unit and similar size, or of one large family, share one. */
function panelsOf(series, largest, { ratio, family, rounding }) {
  const keys = series.map(({ unit, family }) => `${unit} ${family}`);
  const groups = [...new Set(keys)].flatMap((key) => {
    const places = keys.flatMap((own, i) => (own === key ? [i] : []));
    if (series[places[0]].family || places.length > family) return [places];
    const zero = rounding * Math.max(0, ...places.map((i) => largest[i]));
    const found = [];
    for (const i of [...places].sort((a, b) => largest[b] - largest[a])) {
      const apart = found.length && largest[i] > zero && largest[i] < largest[found.at(-1)[0]] / ratio;
      if (!found.length || apart) found.push([]);
      found.at(largest[i] > zero ? -1 : 0).push(i);
    }
    return found.map((group) => group.sort((a, b) => a - b));
  });
  groups.sort((a, b) => a[0] - b[0]);
  const panels = Array(series.length).fill(0);
  groups.forEach((group, number) => group.forEach((i) => (panels[i] = number)));
  return panels;
}

/** Return a plot of a run for plots.js. */
function plotOf(spec, content, columns, happenings) {
  const sides = new Sides(content, columns.time, happenings);
  const values = spec.series.map(({ column }) => columns.at(column));
  const residuals = spec.log;
  const panels = residuals ? spec.series.map(() => 0) : panelsOf(spec.series, values.map(largestOf), content.panels);
  const series = spec.series.map(({ column, jumps, family, ...curve }, i) => {
    const idle = residuals && happenings?.rows.includes(curve.constraint) ? happenings.open(curve.constraint, columns.time) : null;
    const shown = idle ? values[i].map((value, k) => (idle[k] ? NaN : value)) : values[i];
    return { ...curve, panel: panels[i], values: sides.values(curve.name, shown, jumps) };
  });
  return { ...spec, series, time: sides.times(), marks: Float64Array.from(happenings?.times.slice(0, 400) ?? []) };
}

/** Smallest and largest finite value, from others on. */
function rangeOf(values, [low, high] = [Infinity, -Infinity]) {
  for (const value of values) {
    if (!Number.isFinite(value)) continue;
    if (value < low) low = value;
    if (value > high) high = value;
  }
  return [low, high];
}

/** The scene of a run: as `Scene` in lagcli/pictures/scene/scene.py. */
class SceneMaker {
  constructor(content, columns, happenings) {
    [this.spec, this.columns, this.happenings, this.names] = [content.scene, columns, happenings, content.names];
    const series = (places) => places.map((place) => SceneMaker.#constant(columns.at(place)));
    this.points = Object.fromEntries(Object.entries(this.spec.points).map(([name, places]) => [name, series(places)]));
    this.discs = this.spec.shapes.flatMap((shape) => (shape.kind === "disc" ? [this.#disc(shape, series)] : []));
  }

  /** A column with one value only, as one number. */
  static #constant(column) {
    return column.every((value) => value === column[0]) ? column.slice(0, 1) : column;
  }

  #disc(shape, series) {
    const [radius] = series([shape.radius]);
    const [angle] = shape.angle === null ? [null] : series([shape.angle]);
    return { ...shape, radius, angle, normal: shape.normal && series(shape.normal) };
  }

  scene() {
    const { spec, columns } = this;
    const extent = this.#extent();
    const vectors = this.#scaled(this.spec.vectors.flatMap((vector) => this.#vector(vector, extent)), extent);
    const bounds = this.#bounds(extent, vectors);
    const flashes = this.happenings ? this.#flashes(vectors) : [];
    const others = spec.shapes.map((shape) => this.discs.find(({ kind, name }) => kind === shape.kind && name === shape.name) ?? shape);
    return {
      ...{ dimension: spec.dimension, unit: spec.unit, bounds, time: columns.time, points: this.points },
      reach: this.#reach(bounds, vectors),
      shapes: [...others, ...vectors.map((vector) => this.#closed(vector)), ...flashes],
    };
  }

  static at(series, i) {
    return series[series.length > 1 ? i : 0];
  }

  #extent() {
    const places = Object.values(this.points);
    const extent = Array.from({ length: this.spec.dimension }, (_, axis) => places.reduce((range, place) => rangeOf(place[axis], range), undefined));
    const count = this.columns.time.length;
    for (const { center, radius, normal } of this.discs)
      for (let axis = 0; axis < extent.length; axis++)
        for (let i = 0; i < count; i++) {
          const at = (series) => SceneMaker.at(series, i);
          let reach = Math.abs(at(radius));
          if (normal) reach *= Math.sqrt(Math.max(0, 1 - (at(normal[axis]) / Math.hypot(...normal.map(at))) ** 2));
          const middle = at(this.points[center][axis]);
          extent[axis] = rangeOf([middle - reach, middle + reach], extent[axis]);
        }
    return extent.map(([low, high]) => (low <= high ? [low, high] : [0, 0]));
  }

  static #size(extent) {
    return Math.max(...extent.map(([low, high]) => high - low)) || 1;
  }

  #vector(vector, extent) {
    const { entries, work, points, ...rest } = vector;
    const shown = { kind: "vector", ...rest };
    if (!entries) return [{ ...shown, at: points[0], components: rest.components.map((place) => this.columns.at(place)) }];
    const forces = this.#forces(points, entries, work, SceneMaker.#size(extent));
    return points.map((at, k) => ({ ...shown, at, components: forces.slice(k * this.spec.dimension, (k + 1) * this.spec.dimension) }));
  }

  /**
   * The forces F at points with Jᵀ F = λ b, of least norm; if the points cannot move in every direction,
   * those whose sum and moment are 0. As PointForce in lagcli/pictures/scene/view_evaluator.py, which has
   * found when the page was made that there are such forces.
   */
  #forces(names, entries, work, size) {
    const [count, dimension, n] = [this.columns.time.length, this.spec.dimension, work.length];
    const width = names.length * dimension;
    const matrices = [];
    const scale = Array(n).fill(0);
    const entry = entries.map((place) => this.columns.at(place));
    for (let j = 0; j < n; j++)
      for (let i = 0; i < count; i++) {
        let square = 0;
        for (let row = 0; row < width; row++) square += entry[row * n + j][i] ** 2;
        scale[j] = Math.max(scale[j], Math.sqrt(square) || 0);
      }
    for (let i = 0; i < count; i++)
      matrices.push(scale.map((s, j) => Array.from({ length: width }, (_, row) => entry[row * n + j][i] / (s || 1))));
    const right = (i) => scale.map((s, j) => this.columns.at(work[j])[i] / (s || 1));
    const unique = n >= width && matrices.some((matrix) => LeastNorm.full(matrix));
    const forces = Array.from({ length: width }, () => new Float64Array(count));
    for (let i = 0; i < count; i++) {
      const balance = unique || names.length < 2 ? [] : this.#resultants(names, i, size);
      const found = LeastNorm.solve([...matrices[i], ...balance], [...right(i), ...balance.map(() => 0)]);
      for (let row = 0; row < width; row++) forces[row][i] = found[row];
    }
    return forces;
  }

  /** Rows that give the sum and the moment of forces at points. */
  #resultants(names, i, size) {
    const { dimension } = this.spec;
    const places = names.map((name) => this.points[name].map((series) => SceneMaker.at(series, i) / size));
    const middle = places[0].map((_, axis) => places.reduce((sum, place) => sum + place[axis], 0) / places.length);
    const arms = places.map((place) => place.map((x, axis) => x - middle[axis]));
    const row = (value) => arms.flatMap((arm) => arm.map((_, axis) => value(arm, axis)));
    const sums = middle.map((_, wanted) => row((arm, axis) => (axis === wanted ? 1 : 0)));
    const turns = dimension === 2 ? [[0, 1]] : [[1, 2], [2, 0], [0, 1]];
    return [...sums, ...turns.map(([a, b]) => row((arm, axis) => (axis === b ? arm[a] : axis === a ? -arm[b] : 0)))];
  }

  /** Vectors of one unit share a scale; see `scaled` in scene.py. */
  #scaled(vectors, extent) {
    const size = SceneMaker.#size(extent);
    const groups = new Map();
    const lengths = vectors.map(({ components, unit, quantity }) => {
      const length = Float64Array.from(components[0], (_, i) => Math.hypot(...components.map((x) => x[i])));
      const key = unit || quantity;
      const group = groups.get(key) ?? { largest: 0, squares: 0, count: 0 };
      for (const x of length)
        if (x > 0 && Number.isFinite(x)) {
          group.largest = Math.max(group.largest, x);
          group.squares += x * x;
          group.count++;
        }
      groups.set(key, group);
      return length;
    });
    return vectors.map((vector, k) => {
      const { largest, squares, count } = groups.get(vector.unit || vector.quantity);
      const long = count ? Math.min(largest, 3 * Math.sqrt(squares / count)) : 0;
      const rounding = (i) => lengths[k][i] < this.spec.rounded * largest;
      const components = vector.components.map((x) => x.map((value, i) => (rounding(i) ? 0 : value)));
      return { ...vector, components, scale: long > 0 ? (this.spec.long * size) / long : 1 };
    });
  }

  /** The ends of a vector, by axis. */
  #tips({ at, components, scale }) {
    return components.map((x, axis) => x.map((value, i) => SceneMaker.at(this.points[at][axis], i) + scale * value));
  }

  #bounds(extent, vectors) {
    const whole = vectors.reduce((found, vector) => this.#tips(vector).map((tip, axis) => rangeOf(tip, found[axis])), extent);
    const size = SceneMaker.#size(whole);
    return whole.map(([low, high]) => {
      const half = Math.max(high - low, this.spec.least * size) / 2 + this.spec.margin * size;
      return [(low + high) / 2 - half, (low + high) / 2 + half];
    });
  }

  #reach(bounds, vectors) {
    const middle = bounds.map(([low, high]) => (low + high) / 2);
    const away = ([x, y]) => {
      let most = 0;
      for (let i = 0; i < Math.max(x.length, y.length); i++) {
        const r = Math.hypot(SceneMaker.at(x, i) - middle[0], SceneMaker.at(y, i) - middle[1]);
        if (r > most && Number.isFinite(r)) most = r;
      }
      return most;
    };
    const far = [
      ...Object.values(this.points).map(away),
      ...vectors.map((vector) => away(this.#tips(vector))),
      ...this.discs.map(({ center, radius }) => away(this.points[center]) + largestOf(radius)),
    ];
    return Math.max(0, ...far) + this.spec.margin * Math.max(...bounds.map(([low, high]) => high - low));
  }

  /** The force of a constraint, 0 while it is open. */
  #closed(vector) {
    if (!this.happenings?.rows.includes(vector.constraint)) return vector;
    const open = this.happenings.open(vector.constraint, this.columns.time);
    return { ...vector, components: vector.components.map((x) => x.map((value, i) => (open[i] ? 0 : value))) };
  }

  /** Flashes at the impacts of contacts whose forces are drawn. */
  #flashes(vectors) {
    const { time } = this.columns;
    const places = new Map();
    for (const { parts, at } of vectors) for (const name of parts) places.set(name, [...(places.get(name) ?? []), at]);
    const [first, last] = [time[0], time[time.length - 1]];
    const seen = this.happenings.entries.filter((e) => e.kind === "impact" && places.has(e.name) && e.time >= first && e.time <= last);
    const strength = ({ name, impulse }) => Math.abs(impulse[this.names.constraints.indexOf(name)]);
    const largest = Math.max(0, ...seen.map(strength));
    const kept = seen.filter((entry) => strength(entry) > this.spec.flashes.weak * largest).slice(0, this.spec.flashes.most);
    const between = (series, t) => {
      const i = Math.min(Math.max(0, time.findIndex((x) => x >= t) - 1), time.length - 1);
      const j = Math.min(i + 1, time.length - 1);
      const part = time[j] > time[i] ? (t - time[i]) / (time[j] - time[i]) : 0;
      return (1 - part) * SceneMaker.at(series, i) + part * SceneMaker.at(series, j);
    };
    return [...new Set(kept.map(({ name }) => name))].map((name) => {
      const mine = kept.filter((entry) => entry.name === name);
      const at = Array.from({ length: this.spec.dimension }, (_, axis) =>
        Float64Array.from(mine, (entry) => {
          const points = places.get(name);
          return points.reduce((sum, point) => sum + between(this.points[point][axis], entry.time), 0) / points.length;
        }),
      );
      return {
        ...{ kind: "flash", name, at, life: this.spec.flashes.life * (last - first) },
        times: Float64Array.from(mine, (entry) => entry.time),
        strengths: Float64Array.from(mine, (entry) => strength(entry) / largest),
      };
    });
  }
}

/** Small linear equations A x = b: x of least norm, by singular values (one-sided Jacobi rotations). */
class LeastNorm {
  static SINGULAR = 1e-9;
  static NEVER = 1e-6;

  /** Return the columns U S, of lengths S, and V with A = U S Vᵀ; rows of A are lists. */
  static #factors(matrix) {
    const n = matrix[0].length;
    const columns = Array.from({ length: n }, (_, j) => matrix.map((row) => row[j]));
    const turns = Array.from({ length: n }, (_, j) => Array.from({ length: n }, (_, i) => (i === j ? 1 : 0)));
    const dot = (a, b) => a.reduce((sum, x, i) => sum + x * b[i], 0);
    for (let sweep = 0; sweep < 30; sweep++) {
      let rotated = false;
      for (let p = 0; p < n; p++)
        for (let q = p + 1; q < n; q++) {
          const [a, b, c] = [dot(columns[p], columns[p]), dot(columns[q], columns[q]), dot(columns[p], columns[q])];
          if (!(Math.abs(c) > 1e-15 * Math.sqrt(a * b))) continue;
          rotated = true;
          const zeta = (b - a) / (2 * c);
          const tangent = (zeta < 0 ? -1 : 1) / (Math.abs(zeta) + Math.hypot(1, zeta));
          const cosine = 1 / Math.hypot(1, tangent);
          for (const list of [columns, turns]) {
            const [x, y] = [list[p], list[q]];
            list[p] = x.map((value, i) => cosine * (value - tangent * y[i]));
            list[q] = y.map((value, i) => cosine * (value + tangent * x[i]));
          }
        }
      if (!rotated) break;
    }
    return { columns, turns, sizes: columns.map((column) => Math.sqrt(dot(column, column))) };
  }

  /** Whether a matrix has the rank of its columns. */
  static full(matrix) {
    const { sizes } = LeastNorm.#factors(matrix);
    return Math.min(...sizes) > LeastNorm.NEVER * Math.max(...sizes);
  }

  /** Return x; directions whose singular value is less than a part of the largest have no part in it. */
  static solve(matrix, right, singular = LeastNorm.SINGULAR) {
    const { columns, turns, sizes } = LeastNorm.#factors(matrix);
    const least = singular * Math.max(...sizes);
    const found = turns.map(() => 0);
    columns.forEach((column, j) => {
      if (!(sizes[j] > least)) return;
      const part = column.reduce((sum, x, i) => sum + x * right[i], 0) / sizes[j] ** 2;
      turns[j].forEach((x, i) => (found[i] += part * x));
    });
    return found;
  }
}

/** Speed at which a motion is shown: real time, unless it is short or long. */
function usualSpeed(span) {
  const [SHORT, LONG, SLOWED] = [1, 60, 4]; // as in lagcli/pictures/scene/timing.py
  const power = (x) => 10 ** Math.floor(Math.log10(x));
  const steps = (x) => [1, 2, 5, 10, 20, 50].map((n) => Number((n * power(x)).toPrecision(1)));
  if (span > LONG) return steps(span / LONG).find((step) => step >= (span / LONG) * (1 - 1e-9));
  if (span > 0 && span < SHORT) return steps(span / SLOWED).findLast((step) => step <= (span / SLOWED) * (1 + 1e-9));
  return 1;
}

/** Largest number of entries of the log on a page. */
const MOST_ENTRIES = 200;

/** Return what the page draws of a run. */
function answerOf(content, run, request) {
  const columns = new Columns(content, run.columns);
  const happenings = content.log ? new Happenings(content, run.log) : null;
  const { time } = columns;
  const wanted = request.plots.filter((group) => group in content.plots);
  return {
    scene: content.scene ? new SceneMaker(content, columns, happenings).scene() : null,
    plots: Object.fromEntries(wanted.map((group) => [group, plotOf(content.plots[group], content, columns, happenings)])),
    balance: request.balance ? { time, equations: balanceOf(content, columns) } : null,
    events: happenings?.described(MOST_ENTRIES) ?? null,
    speed: usualSpeed(time[time.length - 1] - time[0]),
  };
}

/** The terms of the equations with their values. */
function balanceOf(content, columns) {
  return content.balance.map((equation) => ({
    ...equation,
    terms: equation.terms.map((term) => ({ ...term, values: columns.at(term.values) })),
  }));
}
