// Chromium without packages of npm: the DevTools protocol over a pipe (--remote-debugging-pipe),
// whose messages are JSON that end with a zero byte.
import { spawn, type ChildProcess } from "node:child_process";
import { mkdtempSync, rmSync } from "node:fs";
import { tmpdir } from "node:os";
import { join } from "node:path";
import type { Readable, Writable } from "node:stream";
import type { Api } from "./page";

const START_MS_MAX = 120_000; // of a page; ends a test that hangs

// gl-egl draws with Mesa, on llvmpipe without a GPU. --no-sandbox: root runs it.
const FLAGS = [
  "--headless=new",
  "--no-sandbox",
  "--disable-dev-shm-usage",
  "--no-first-run",
  "--mute-audio",
  "--use-angle=gl-egl",
  "--ignore-gpu-blocklist",
  "--disable-gpu-watchdog", // it ends a process that compiles shaders for long
  "--remote-debugging-pipe",
  "--enable-precise-memory-info",
  "about:blank",
];

type Reply = {
  id?: number;
  method?: string;
  params?: unknown;
  result?: unknown;
  error?: { message: string };
};
type Waiting = { resolve(result: never): void; reject(error: Error): void };
type Evaluated = {
  result: { value: unknown };
  exceptionDetails?: { text: string; exception?: { description?: string } };
};

export class Browser {
  private readonly process: ChildProcess;
  private readonly profile = mkdtempSync(join(tmpdir(), "voxeld-chromium-"));
  private readonly waiting = new Map<number, Waiting>();
  private last = 0;
  private rest = "";
  private session = "";
  readonly console: string[] = [];

  constructor(flags: readonly string[] = []) {
    this.process = spawn("chromium", [...FLAGS, `--user-data-dir=${this.profile}`, ...flags], {
      stdio: ["ignore", "ignore", "ignore", "pipe", "pipe"],
      // Caches of shaders and fonts are those of this run alone.
      env: { ...process.env, HOME: this.profile, XDG_CACHE_HOME: join(this.profile, "cache") },
    });
    const output = this.process.stdio[4] as Readable;
    output.setEncoding("utf8");
    output.on("data", (text: string) => this.receive(text));
    this.process.on("exit", () => this.failAll(new Error("chromium has ended")));
    this.process.on("error", (error) => this.failAll(error));
  }

  send<T>(method: string, params: object = {}): Promise<T> {
    const id = ++this.last,
      session = this.session === "" ? {} : { sessionId: this.session };
    (this.process.stdio[3] as Writable).write(
      JSON.stringify({ id, method, params, ...session }) + "\0",
    );
    return new Promise<T>((resolve, reject) =>
      this.waiting.set(id, { resolve: resolve as never, reject }),
    );
  }

  /** Opens a page and waits until it has set globalThis.api. */
  async open(url: string): Promise<void> {
    const { targetId } = await this.send<{ targetId: string }>("Target.createTarget", {
      url: "about:blank",
    });
    const { sessionId } = await this.send<{ sessionId: string }>("Target.attachToTarget", {
      targetId,
      flatten: true,
    });
    this.session = sessionId;
    await this.send("Runtime.enable");
    await this.send("Page.enable");
    await this.send("Page.navigate", { url });
    for (const end = Date.now() + START_MS_MAX; Date.now() < end; ) {
      if (await this.evaluate<boolean>("typeof api === 'object'")) return;
      await new Promise((resolve) => setTimeout(resolve, 50));
    }
    throw new Error(`${url} did not start: ${this.console.join("; ")}`);
  }

  async evaluate<T>(expression: string): Promise<T> {
    const found = await this.send<Evaluated>("Runtime.evaluate", {
      expression,
      awaitPromise: true,
      returnByValue: true,
    });
    const failed = found.exceptionDetails;
    if (failed) throw new Error(failed.exception?.description ?? failed.text);
    return found.result.value as T;
  }

  /** Calls a function of the page's api. */
  call<K extends keyof Api>(
    name: K,
    ...parameters: Parameters<Api[K]>
  ): Promise<Awaited<ReturnType<Api[K]>>> {
    return this.evaluate(`api.${name}(...${JSON.stringify(parameters)})`);
  }

  async close(): Promise<void> {
    const ended = new Promise((resolve) => this.process.once("exit", resolve));
    this.session = "";
    this.send("Browser.close").catch(() => undefined);
    const timer = setTimeout(() => this.process.kill("SIGKILL"), 60_000);
    await ended;
    clearTimeout(timer);
    rmSync(this.profile, { recursive: true, force: true, maxRetries: 5 });
  }

  private receive(text: string): void {
    const messages = (this.rest + text).split("\0");
    this.rest = messages.pop()!;
    for (const message of messages) this.take(JSON.parse(message) as Reply);
  }

  private take(reply: Reply): void {
    if (reply.method === "Runtime.consoleAPICalled" || reply.method === "Runtime.exceptionThrown") {
      this.console.push(JSON.stringify(reply.params).slice(0, 2000));
    }
    const waiting = this.waiting.get(reply.id ?? 0);
    if (!waiting) return;
    this.waiting.delete(reply.id!);
    if (reply.error) waiting.reject(new Error(reply.error.message));
    else waiting.resolve(reply.result as never);
  }

  private failAll(error: Error): void {
    for (const waiting of this.waiting.values()) waiting.reject(error);
    this.waiting.clear();
  }
}
