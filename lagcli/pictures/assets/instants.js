"use strict";

/*
 * Instants: the times at which a page has the values of the result. Every number that a page shows is
 * read at one of them; between them only pictures move.
 */

const Instants = {
  /** Return the index of the last instant that is not later than a time; 0 if all are later. */
  last(instants, time) {
    let [low, high] = [0, instants.length];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (instants[middle] <= time) low = middle;
      else high = middle;
    }
    return low;
  },

  /** Return the instant nearest to a time. */
  nearest(instants, time) {
    const index = Instants.last(instants, time);
    const [before, after] = [instants[index], instants[index + 1] ?? Infinity];
    return time - before < after - time ? before : after;
  },

  /** Return the first instant that is not before a time: after what happened then. */
  after(instants, time) {
    return instants.find((t) => t >= time) ?? instants[instants.length - 1];
  },

  /** Return the instant nearest to a time that is gone to; another one than now, if there is one. */
  step(instants, now, time) {
    const found = Instants.nearest(instants, time);
    if (found !== now) return found;
    const beyond = time < now ? instants.findLast((t) => t < now) : instants.find((t) => t > now);
    return beyond ?? now;
  },
};
