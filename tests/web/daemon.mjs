// A daemon with a data directory of its own, and the programs beside it.
import { execFileSync, spawn } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";

const bin = process.env.VOXELD_BIN_DIR;

/** Runs a program of the project; returns its standard output as text. */
export function run(name, args, options = {}) {
  return execFileSync(join(bin, name), args, { encoding: "utf8", ...options });
}

export function temporaryFolder(name) {
  return mkdtempSync(join(tmpdir(), `voxeld-${name}-`));
}

export class Daemon {
  constructor() {
    this.data = temporaryFolder("web-data");
    this.port = 0; // the same after a restart
  }

  async start(args = []) {
    this.process = spawn(
      join(bin, "voxeld"),
      [
        "serve",
        "--listen",
        `127.0.0.1:${this.port}`,
        "--admin-listen",
        "none",
        "--data",
        this.data,
        "--device",
        "cpu",
        "--log-level",
        "error",
        ...args,
      ],
      { stdio: ["ignore", "pipe", "inherit"] },
    );
    const line = await new Promise((resolve, reject) => {
      let text = "";
      this.process.stdout.on("data", data => {
        text += data;
        if (text.includes("\n")) resolve(text);
      });
      this.process.on("exit", code => reject(new Error(`the daemon ended with ${code}: ${text}`)));
    });
    this.port = Number(/^ready http:\/\/127\.0\.0\.1:(\d+)/.exec(line)[1]);
    this.url = `http://127.0.0.1:${this.port}`;
    return this;
  }

  async stop(signal = "SIGTERM") {
    const ended = new Promise(resolve => this.process.on("exit", resolve));
    this.process.kill(signal);
    return await ended;
  }

  async end() {
    const isUp = this.process.exitCode === null && this.process.signalCode === null;
    const code = isUp ? await this.stop() : 0;
    rmSync(this.data, { recursive: true, force: true });
    if (code !== 0) throw new Error(`the daemon ended with ${code}`);
  }

  keys(...args) {
    return run("voxeld", ["keys", ...args, "--data", this.data]).trim();
  }

  async json(path, options = {}) {
    return await (await fetch(this.url + path, options)).json();
  }
}
