"use strict";

/*
 * Simulator: what answers the page instead of the server of `lagcli play`. It has the same messages.
 *
 *   const simulator = new Simulator(content);   // content: JSON of lagcli/live/content.py
 *   simulator.onMessage((answer) => …);
 *   simulator.send(request);
 *
 * The runs are made by a worker, whose scripts and data are in the page.
 */

class Simulator {
  constructor(content) {
    this.content = content;
    this.open = true;
    this.waiting = []; // answers before somebody listens
    this.refines = true; // a run of lower accuracy while a slider moves
    this.#start().catch((error) => this.#break(error));
  }

  onMessage(take) {
    this.take = take;
    for (const answer of this.waiting.splice(0)) take(answer);
  }

  onClose(closed) {
    this.closed = closed;
  }

  send(request) {
    if (request.save) this.#answer({ files: this.content.files });
    else this.worker.postMessage(request);
  }

  #answer(answer) {
    if (this.take) this.take(answer);
    else this.waiting.push(answer);
  }

  async #start() {
    const text = (id) => document.getElementById(id).textContent;
    const source = new Blob([text("worker")], { type: "text/javascript" });
    const address = URL.createObjectURL(source);
    this.worker = new Worker(address);
    this.worker.addEventListener("error", (event) => {
      event.preventDefault();
      this.#break(event);
    });
    this.worker.addEventListener("message", ({ data }) => {
      if (data.ready) this.#answer(this.content.hello);
      else if (data.broken) this.#break({ message: data.broken });
      else this.#answer(data);
    });
    const [core, model, values] = await Promise.all(["core", "model", "values-data"].map((id) => Simulator.#unpacked(text(id))));
    const { content } = this;
    this.worker.postMessage({ content, core, model, values, words });
    URL.revokeObjectURL(address);
  }

  /** Return the bytes of a text: base64 of gzip. */
  static async #unpacked(text) {
    const packed = Uint8Array.from(atob(text.trim()), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("gzip"));
    return new Uint8Array(await new Response(stream).arrayBuffer());
  }

  #break(error) {
    this.open = false;
    const why = error?.message ? ` (${error.message})` : "";
    const text = say("This page cannot simulate here: the browser is too old, or the page's host forbids WebAssembly or workers. Save the page and open it from a file.");
    this.closed?.(`${text}${why}`);
  }
}
