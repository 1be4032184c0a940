"use strict";

/*
 * Runs of the page's model: a request as `lagcli play` has it, its run by the core, and the answer.
 *
 *   const runs = new Runs(content, core);
 *   const answer = await runs.answer(request, () => …);  // whether a newer one waits; null where that ended it
 */

class Runs {
  static LONGEST = 5; // s, of a run
  static GRACE = 0.25; // s for which a run may go on while a newer request waits
  static SLICE = 8; // ms between two looks at requests
  static COARSE = 1e-6; // relative tolerance while a slider moves
  static MOST_SAMPLES = 4001;
  static ROUGH = 1e-3; // of derivatives by differences: what is smaller is rounding

  constructor(content, core) {
    [this.content, this.core] = [content, core];
    const { coordinates } = content.names;
    this.states = [...coordinates, ...coordinates.map((name) => `${name}'`)];
    this.last = null; // the columns of the last run
    this.dragged = null;
  }

  async answer(request, isNewer) {
    const { number } = request;
    const command = this.command(request);
    try {
      if (request.drag) return { number, command, ...this.#drag(request) };
      const run = await this.#run(request, isNewer);
      return run && { number, command, ...run };
    } catch (error) {
      return { number, command, error: error.message };
    }
  }

  async #run(request, isNewer) {
    const { content, core } = this;
    const given = this.#given(request);
    const t_end = this.#end(request.t_end);
    const times = this.times(t_end);
    const { rtol } = content.settings;
    const began = performance.now();
    const since = () => (performance.now() - began) / 1000;
    if (!core.begin(given, times, t_end, request.coarse ? Math.max(rtol, Runs.COARSE) : 0)) throw new Error(sayCore(core.message()));
    let status = Core.UNDER_WAY;
    let steps = 50;
    while (status === Core.UNDER_WAY) {
      const slice = performance.now();
      while (status === Core.UNDER_WAY && performance.now() - slice < Runs.SLICE) status = core.goOn(steps);
      if (status !== Core.UNDER_WAY) break;
      await Runs.#pause();
      if (isNewer() && since() > Runs.GRACE) return null;
      if (since() > Runs.LONGEST) break;
    }
    const columns = core.samples();
    if (!columns[0].length) throw new Error(status === Core.FAILED ? sayCore(core.message()) : say("no sample was reached in time"));
    for (const { text, column, most } of content.checks) {
      const [value] = columns[column];
      const range = most === null ? say("must not be negative") : `${say("must be between 0 and")} ${most}`;
      if (value < 0 || (most !== null && value > most)) throw new Error(`${text}: ${Number(value.toPrecision(6))}; ${range}`);
    }
    let message = "";
    if (status === Core.FAILED) message = sayCore(core.message());
    if (status === Core.UNDER_WAY) message = `${say("the run was stopped after so many seconds:")} ${Runs.LONGEST}`;
    this.last = columns;
    const log = content.log ? core.log() : null;
    return {
      ...this.#values(given, t_end),
      ...answerOf(content, { columns, log }, request),
      status: status === Core.DONE ? "completed" : "failed",
      message,
      method: content.method,
      counts: { steps: core.steps },
      seconds: since(),
    };
  }

  /** Let messages come in. */
  static #pause() {
    return new Promise((done) => {
      const { port1, port2 } = new MessageChannel();
      port1.onmessage = () => {
        port1.close();
        done();
      };
      port2.postMessage(null);
    });
  }

  /** Return the sample times up to an end. */
  times(t_end) {
    const { t_start, t_end: own, count, dt, times } = this.content.settings;
    if (times) return Float64Array.from(times);
    if (dt !== null) {
      const most = Math.floor(((t_end - t_start) / dt) * (1 + 1e-12) + 1e-9) + 1;
      if (t_end === own || most <= Runs.MOST_SAMPLES) return Float64Array.from({ length: most }, (_, i) => Math.min(t_start + dt * i, t_end));
    }
    const samples = t_end === own ? count : Math.max(2, Math.min(count, Runs.MOST_SAMPLES));
    if (samples === 1) return Float64Array.of(t_end);
    const step = (t_end - t_start) / (samples - 1);
    return Float64Array.from({ length: samples }, (_, i) => (i === samples - 1 ? t_end : i * step + t_start));
  }

  #number(text, name) {
    const value = Number(text);
    if (text.trim() === "" || !Number.isFinite(value)) throw new Error(`${name}: ${say("a value on this page is a number, not")} ${text}`);
    return value;
  }

  #end(text) {
    const { t_start, t_end } = this.content.settings;
    if (!text) return t_end;
    const value = this.#number(text, "t_end");
    if (!(value > t_start)) throw new Error(`t_end: ${say("the end is after the start, at")} ${t_start} s`);
    return value;
  }

  /** Return what the core is given, in SI. */
  #given(request) {
    const { controls, names } = this.content;
    const known = (name) => {
      if (name in controls) return controls[name];
      throw new Error(`${name}: ${say("the model has no such value")}`);
    };
    const parameters = Object.entries(request.set).map(([name, text]) => [
      names.parameters.indexOf(name),
      this.#number(text, name) * known(name).factor,
    ]);
    const initial = Object.entries(request.set_initial).map(([name, text]) => {
      const guess = /^\{guess: (.*)\}$/s.exec(text);
      return [this.states.indexOf(name), this.#number(guess?.[1] ?? text, name) * known(name).factor, guess !== null];
    });
    return { parameters, initial };
  }

  /** Return a value in the unit of its control, with its original digits. */
  shown(name, value) {
    const { factor } = this.content.controls[name];
    return factor === 1 ? value : Number((value / factor).toPrecision(15));
  }

  /** Return the values of all controls, and where guesses start. */
  #values({ initial }, t_end) {
    const { content } = this;
    const { parameters, given, state } = this.core.start();
    const values = {};
    content.names.parameters.forEach((name, i) => {
      if (name in content.controls) values[name] = this.shown(name, parameters[i]);
    });
    this.states.forEach((name, i) => (values[name] = this.shown(name, given[i])));
    const guesses = new Set(content.guesses);
    for (const [number, , guess] of initial) guesses[guess ? "add" : "delete"](this.states[number]);
    const start = {};
    this.states.forEach((name, i) => {
      if (guesses.has(name)) start[name] = this.shown(name, state[i]);
    });
    // what the constraints determine is known for the guesses of the model
    const own = guesses.size === content.guesses.length && content.guesses.every((name) => guesses.has(name));
    return { values, start, determined: own ? content.determined : [], t_end };
  }

  /** Return the command line that repeats a run, quoted for the shell. */
  command({ set, set_initial, t_end }) {
    const { command, controls } = this.content;
    const quoted = (word) => (/^[\w@%+=:,./-]+$/.test(word) ? word : `'${word.replaceAll("'", `'"'"'`)}'`);
    const written = (text, name) => {
      const guess = /^\{guess: (.*)\}$/s.exec(text);
      const suffix = controls[name]?.suffix ?? "";
      return guess ? `{guess: ${guess[1]}${suffix}}` : `${text}${suffix}`;
    };
    const words = [command.words];
    for (const [option, own, values] of [
      ["--set", command.set, set],
      ["--set-initial", command.set_initial, set_initial],
    ]) {
      const changed = Object.fromEntries(Object.entries(values).map(([name, text]) => [name, written(text, name)]));
      for (const [name, text] of Object.entries({ ...own, ...changed })) words.push(option, quoted(`${name}=${text}`));
    }
    if (t_end) words.push("--t-end", quoted(t_end));
    return [...words, "-o", "run.h5"].join(" ");
  }

  // dragging: the initial state in which a point of the mechanism is next to a place

  /** Return changed initial values, and the picture of their state. */
  #drag(request) {
    const { drag } = request;
    if (this.dragged?.gesture !== drag.gesture) this.dragged = this.#grasped(request);
    const { dragged } = this;
    dragged.pose = this.#nearest(dragged, drag);
    const { q, columns } = dragged.pose;
    const initial = {};
    const digits = (x) => (Math.abs(x) < 1e-14 ? 0 : Number(x.toPrecision(13)));
    q.forEach((value, i) => {
      if (digits(value) !== digits(dragged.start[i])) initial[this.states[i]] = this.shown(this.states[i], digits(value));
    });
    const { scene } = answerOf(this.content, { columns, log: [] }, { plots: [], balance: false });
    const fixed = (name) => !(request.set_initial[name]?.startsWith("{") ?? this.content.guesses.includes(name));
    const changed = Object.entries(initial).map(([name, value]) => [name, fixed(name) ? String(value) : `{guess: ${value}}`]);
    const command = this.command({ ...request, set_initial: { ...request.set_initial, ...Object.fromEntries(changed) } });
    return { gesture: drag.gesture, initial, scene, command };
  }

  #grasped(request) {
    const given = this.#given(request);
    const nq = this.states.length / 2;
    const start = this.#pose(given, null);
    const time = this.last[0];
    const after = Math.max(1, time.findIndex((t) => t >= request.drag.time));
    const q = Array.from({ length: nq }, (_, i) => {
      const [a, b] = [this.last[1 + i][after - 1], this.last[1 + i][after] ?? this.last[1 + i][after - 1]];
      const span = time[after] - time[after - 1];
      return a + (span > 0 ? (request.drag.time - time[after - 1]) / span : 0) * (b - a);
    });
    return { gesture: request.drag.gesture, given, start: start.q, pose: this.#pose(given, q) };
  }

  /** Return the consistent state next to a configuration, null for that of the values themselves. */
  #pose(given, q) {
    const { core, content } = this;
    const nq = this.states.length / 2;
    const guesses = q ? [...q].map((value, i) => [i, value, true]) : given.initial.filter(([number]) => number < nq);
    const velocities = given.initial.filter(([number]) => number >= nq).map(([number, value]) => [number, value, true]);
    // velocities follow the configuration here; a run says where they contradict it
    const every = Array.from({ length: nq }, (_, i) => nq + i).flatMap((number) =>
      velocities.some(([own]) => own === number) ? [] : [[number, content.velocities[number - nq], true]],
    );
    const { t_start, t_end } = content.settings;
    const parameters = given.parameters;
    if (!core.begin({ parameters, initial: [...guesses, ...velocities, ...every] }, Float64Array.of(t_start), t_end)) throw new Error(sayCore(core.message()));
    if (core.goOn(0) === Core.FAILED) throw new Error(sayCore(core.message()));
    const columns = core.samples();
    if (!columns[0].length) throw new Error(say("the motion has no start there"));
    return { q: Array.from({ length: nq }, (_, i) => columns[1 + i][0]), columns };
  }

  /** Move a point towards a place by damped Gauss–Newton steps; derivatives are differences of poses. */
  #nearest({ given, pose }, { weights, target, eye, length }) {
    const sight = eye ? target.map((x, i) => x - eye[i]) : null;
    const square = sight ? sight.reduce((sum, x) => sum + x * x, 0) : 1;
    const away = ({ columns }) => {
      const at = target.map((x, axis) => {
        const place = Object.entries(weights).reduce((sum, [name, weight]) => sum + weight * columns[this.content.scene.points[name][axis]][0], 0);
        return (place - x) / length;
      });
      if (!sight) return at;
      const along = at.reduce((sum, x, i) => sum + x * sight[i], 0) / square;
      return at.map((x, i) => x - along * sight[i]);
    };
    const norm = (list) => Math.hypot(...list);
    const tried = (q) => {
      try {
        return this.#pose(given, q);
      } catch {
        return null; // beyond what the constraints allow
      }
    };
    const sizes = pose.q.map((_, i) => (this.content.angles[i] ? 1 : length));
    let [here, left] = [pose, away(pose)];
    for (let step = 0; step < 6 && norm(left) > 1e-4; step++) {
      const slopes = sizes.map((size, i) => {
        const h = 1e-5 * size;
        const moved = tried(here.q.map((x, k) => (k === i ? x + h : x)));
        return moved ? away(moved).map((x, k) => (x - left[k]) / 1e-5) : left.map(() => 0);
      });
      const change = LeastNorm.solve(
        left.map((_, k) => slopes.map((slope) => slope[k])),
        left.map((x) => -x),
        Runs.ROUGH,
      );
      const most = Math.max(...change.map(Math.abs));
      let [part, better] = [Math.min(1, 0.5 / (most || 1)), null];
      for (; part > 1e-2 && !better; part /= 2) {
        const next = tried(here.q.map((x, i) => x + part * sizes[i] * change[i]));
        if (next && norm(away(next)) < norm(left)) better = next;
      }
      if (!better) break;
      [here, left] = [better, away(better)];
    }
    return here;
  }
}
