// A daemon of its own, on the CPU, with the project's samples.
import { execFileSync, spawn, type ChildProcess } from "node:child_process";
import { mkdtempSync, readFileSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import { createInterface } from "node:readline";

export class Daemon {
  private readonly folder = mkdtempSync(join(tmpdir(), "voxeld-view-daemon-"));
  private readonly fixtures = join(this.folder, "fixtures");
  private process: ChildProcess | null = null;
  private url = "";

  constructor(private readonly bin: string) {}

  async start(): Promise<void> {
    execFileSync(join(this.bin, "voxeld_make_fixtures"), [this.fixtures], { stdio: "ignore" });
    this.process = spawn(
      join(this.bin, "voxeld"),
      [
        "serve",
        "--listen",
        "127.0.0.1:0",
        "--admin-listen",
        "127.0.0.1:0",
        "--data",
        join(this.folder, "data"),
        "--device",
        "cpu",
      ],
      { stdio: ["ignore", "pipe", "ignore"] },
    );
    for await (const line of createInterface({ input: this.process.stdout! })) {
      const match = /^ready (http:\S+)/.exec(line);
      if (!match) continue;
      this.url = match[1]!;
      return;
    }
    throw new Error("the daemon did not start");
  }

  /** Sends a sample's mesh, or another file's, and returns the response's body. */
  async post(
    route: string,
    mesh: string,
    query: Record<string, string | number>,
  ): Promise<Uint8Array> {
    const text = Object.entries(query)
      .map(([name, value]) => `${name}=${encodeURIComponent(value)}`)
      .join("&");
    const path = mesh.startsWith("/") ? mesh : join(this.fixtures, mesh);
    const response = await fetch(
      `${this.url}/v1/${route}?filename=${mesh.split("/").pop()}&${text}`,
      { method: "POST", body: readFileSync(path) },
    );
    const body = new Uint8Array(await response.arrayBuffer());
    if (!response.ok)
      throw new Error(`${route} ${text}: ${response.status} ${new TextDecoder().decode(body)}`);
    return body;
  }

  async stop(): Promise<void> {
    const { process } = this;
    if (process && process.exitCode === null) {
      const ended = new Promise((resolve) => process.once("exit", resolve));
      process.kill("SIGTERM");
      await ended;
    }
    rmSync(this.folder, { recursive: true, force: true });
  }
}
