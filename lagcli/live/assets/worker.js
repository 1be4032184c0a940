"use strict";

/*
 * The worker of the page: it compiles the core, and answers requests one after the other. A newer request
 * replaces one that waits.
 */

let runs = null;
let waiting = null;
let busy = false;

async function work() {
  if (busy || !runs) return;
  busy = true;
  while (waiting) {
    const request = waiting;
    waiting = null;
    const answer = await runs.answer(request, () => waiting !== null);
    if (answer) postMessage(answer);
  }
  busy = false;
}

onmessage = async ({ data }) => {
  if (!("content" in data)) {
    waiting = data;
    work();
    return;
  }
  useWords(data.words);
  try {
    const module = await WebAssembly.compile(data.core);
    runs = new Runs(data.content, new Core(module, data.model, data.values));
    postMessage({ ready: true });
  } catch (error) {
    postMessage({ broken: `${error.name}: ${error.message}` });
    return;
  }
  work();
};
