"use strict";

/*
 * Motion: the numbers of a scene at any time, between the samples too.
 *
 * A series is a list of one number per sample, or of one number where it is constant; what is not
 * finite (null in JSON) is not drawn. Needs instants.js.
 */

class Motion {
  /** @param {object} data  a scene; see Scene */
  constructor(data) {
    this.time = data.time;
    this.points = data.points;
    this.seek(this.start);
  }

  get start() {
    return this.time[0];
  }

  get end() {
    return this.time[this.time.length - 1];
  }

  /** Go to a time; what lies outside the samples is brought to the nearer end. */
  seek(time) {
    this.now = Math.max(this.start, Math.min(this.end, time));
    this.index = this.indexAt(this.now);
    const [from, to] = [this.time[this.index], this.time[this.index + 1]];
    this.weight = to > from ? (this.now - from) / (to - from) : 0;
  }

  /** Return the last sample at or before a time that leaves one after it. */
  indexAt(time) {
    return Math.max(0, Math.min(Instants.last(this.time, time), this.time.length - 2));
  }

  /** Return a series now. */
  value(series) {
    if (series.length === 1) return series[0] ?? NaN;
    const here = series[this.index] ?? NaN;
    if (!this.weight) return here;
    return here + this.weight * ((series[this.index + 1] ?? NaN) - here);
  }

  /** Return a point, by name, or a list of series, now. */
  vector(components) {
    return components.map((series) => this.value(series));
  }

  point(name) {
    return this.vector(this.points[name]);
  }

  /** Return [time, point] from so many seconds ago to now, at most so many of them. */
  past(name, seconds, most) {
    const axes = this.points[name];
    const from = Math.max(this.start, this.now - seconds);
    const [first, last] = [this.indexAt(from), this.index];
    const stride = Math.max(1, Math.ceil((last - first) / most));
    const found = [];
    // samples are counted from the first of all, so that the same ones are shown while time goes on
    for (let i = Math.ceil((first + 1) / stride) * stride; i <= last; i += stride)
      found.push([this.time[i], axes.map((a) => (a.length === 1 ? a[0] : a[i]) ?? NaN)]);
    found.push([this.now, this.point(name)]);
    return found;
  }
}
