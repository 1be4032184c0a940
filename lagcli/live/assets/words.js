"use strict";

/*
 * Words: the texts of a page in its language. A text that has no translation is shown as it is.
 *
 *   useWords({"Reset all": "Alles zurücksetzen"});
 *   say("Reset all");
 */

let words = {};

function useWords(given) {
  words = given;
}

function say(text) {
  return words[text] ?? text;
}

/** Return a message of the core: what it says of a time stays, and its reason is translated. */
function sayCore(message) {
  const [, time, reason] = /^(at t = \S+ s: )?(.*)$/s.exec(message);
  return `${time ?? ""}${say(reason)}`;
}
