// Runs of live pages' models without a browser. On standard input: {scripts, wasm, model, values, cases}
// as JSON, files by their paths; on standard output: what came of each case.
import { readFileSync } from "node:fs";
import { runInThisContext } from "node:vm";

const { scripts, wasm, model, values, cases } = JSON.parse(readFileSync(0, "utf8"));
const text = scripts.map((path) => readFileSync(path, "utf8").replaceAll(/^"use strict";$/gm, "")).join("\n");
const { Core } = runInThisContext(`${text}\n({ Core })`);
const module = new WebAssembly.Module(readFileSync(wasm));
const core = new Core(module, ...[model, values].map((path) => new Uint8Array(readFileSync(path))));

const finite = (x) => (Number.isFinite(x) ? x : null);
const made = cases.map(({ parameters, initial, times, t_end, rtol }) => {
  if (!core.begin({ parameters, initial }, Float64Array.from(times), t_end, rtol ?? 0)) return { error: core.message() };
  let status = Core.UNDER_WAY;
  const began = process.cpuUsage();
  while (status === Core.UNDER_WAY) status = core.goOn(1000);
  const { user, system } = process.cpuUsage(began);
  return {
    status,
    message: status === Core.FAILED ? core.message() : "",
    steps: core.steps,
    seconds: (user + system) / 1e6,
    columns: core.samples().map((column) => Array.from(column, finite)),
    state: [...core.start().state],
    log: core.log().map((entry) => [...entry]),
  };
});
process.stdout.write(JSON.stringify({ imports: WebAssembly.Module.imports(module), made }));
