"use strict";

/*
 * The core as WebAssembly: a model as data, runs of it, and their samples. `core/page/page.h` describes
 * the functions.
 *
 *   const core = new Core(module, model, values);   // a WebAssembly.Module, two Uint8Arrays
 *   core.begin({parameters, initial}, times, t_end, rtol);
 *   while (!core.goOn(200)) …
 *   core.samples();                                 // and core.log(), core.message()
 */

class Core {
  static UNDER_WAY = 0;
  static DONE = 1;
  static FAILED = 2;

  constructor(module, model, values) {
    this.exports = new WebAssembly.Instance(module, {}).exports;
    this.exports._initialize();
    const handed = [model, values].flatMap((bytes) => [this.#place(bytes), bytes.length]);
    this.page = this.exports.lag_page_open(...handed);
    if (!this.page) throw new Error(this.message());
    const counts = [0, 1, 2, 3, 4].map((i) => this.exports.lag_page_count(this.page, i));
    [this.coordinates, this.constraints, this.derived, this.width, this.parameters] = counts;
    this.times = 0; // the place of the sample times
  }

  /** Copy numbers or bytes to the module's memory; returns their address. */
  #place(array) {
    const address = this.exports.lag_page_allocate(array.byteLength);
    if (!address) throw new Error("there is no memory");
    const bytes = new Uint8Array(array.buffer, array.byteOffset, array.byteLength);
    // the memory may have grown: a view of it is never kept
    new Uint8Array(this.exports.memory.buffer, address, bytes.length).set(bytes);
    return address;
  }

  /** Return a copy of numbers in the module's memory. */
  #numbers(address, count) {
    return address ? new Float64Array(this.exports.memory.buffer, address, count).slice() : new Float64Array(0);
  }

  /** Return the last message. */
  message() {
    const bytes = new Uint8Array(this.exports.memory.buffer, this.exports.lag_page_message());
    return new TextDecoder().decode(bytes.slice(0, bytes.indexOf(0)));
  }

  /**
   * Find the consistent initial state and begin a run.
   *
   * @param {object} given  `parameters`, [number, value] of each that is set; `initial`, [number, value,
   *   guess] of q and v
   * @returns {boolean} whether there is such a state; if not, `message` says why
   */
  begin({ parameters, initial }, times, t_end, rtol = 0) {
    const { exports, page } = this;
    exports.lag_page_reset(page);
    const failed =
      parameters.some(([number, value]) => exports.lag_page_set_parameter(page, number, value)) ||
      initial.some(([number, value, guess]) => exports.lag_page_set_initial(page, number, value, guess ? 1 : 0));
    if (failed) return false;
    const at = this.#place(times);
    const status = exports.lag_page_begin(page, at, times.length, t_end, rtol);
    exports.lag_page_release(at);
    return status === 0;
  }

  /** Take about so many steps; returns whether the run goes on, is over or has failed. */
  goOn(steps) {
    return this.exports.lag_page_go_on(this.page, steps);
  }

  get steps() {
    return this.exports.lag_page_steps(this.page);
  }

  /** Return the samples so far: a Float64Array of each number of a sample. */
  samples() {
    const { exports, page, width } = this;
    const count = exports.lag_page_samples(page);
    const rows = new Float64Array(exports.memory.buffer, exports.lag_page_sample_values(page), count * width);
    const columns = Array.from({ length: width }, () => new Float64Array(count));
    for (let i = 0; i < count; i++) for (let k = 0; k < width; k++) columns[k][i] = rows[i * width + k];
    return columns;
  }

  /** Return the parameters, the given initial values of q and v, and the consistent ones. */
  start() {
    const { exports, page, coordinates } = this;
    const given = Array.from({ length: 2 * coordinates }, (_, i) => exports.lag_page_given(page, i));
    const parameters = this.#numbers(exports.lag_page_start_parameters(page), this.parameters);
    return { parameters, given, state: this.#numbers(exports.lag_page_start_state(page), 2 * coordinates) };
  }

  /** Return the entries of the log as lists of numbers: see `lag_log_of` in core/lagmodel.h. */
  log() {
    const { exports, page } = this;
    const [count, width] = [exports.lag_page_log_count(page), exports.lag_page_log_width(page)];
    const numbers = this.#numbers(exports.lag_page_log(page), count * width);
    return Array.from({ length: count }, (_, i) => numbers.slice(i * width, (i + 1) * width));
  }
}
