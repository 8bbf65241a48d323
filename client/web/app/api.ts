// Requests to the daemon: keys, problems, uploads with progress, event streams, and patience with
// a daemon that restarts.
import { hasEnded, type ErrorBody, type JobStatus } from "./model";
import { T } from "./texts";

/** A response that says no, with the members of its problem+json. */
export class Problem extends Error {
  constructor(
    readonly status: number,
    readonly code: string,
    readonly detail: string,
    readonly expected = "",
    readonly got = "",
  ) {
    super(detail);
  }
  static of(error: ErrorBody, status = 0): Problem {
    return new Problem(status, error.code, error.detail, error.expected, error.got);
  }
}

export interface Ask {
  readonly method?: string;
  readonly body?: object; // sent as JSON
  readonly headers?: Readonly<Record<string, string>>;
  readonly signal?: AbortSignal | undefined;
  /** The body is read as it comes. */
  readonly isStream?: boolean;
  /** The signal ends waits between tries, but cuts off no request that is under way. */
  readonly isWhole?: boolean;
  /** It is not repeated when its response is lost: it may have been done. */
  readonly isOnce?: boolean;
}

const PAUSES_MS = [400, 800, 1500, 2500]; // before further tries; then the last one again
const BUSY_TRIES_MAX = 6;
const BAD_RESPONSE = "bad-response"; // code of one that is not the daemon's
const LOST_UPLOADS_MAX = 3; // of one file while the daemon answers; then an error

const CLOCK_MS_MAX = 2000; // that clocks may differ without notice; the Date header has seconds
// Of a stream of events: the daemon writes every 15 s.
const SILENCE_MS = 45_000;

interface Tries {
  lost: number;
  busy: number;
}

function pause(milliseconds: number, signal?: AbortSignal): Promise<void> {
  return new Promise((resolve, reject) => {
    if (signal?.aborted) return reject(signal.reason);
    const timer = setTimeout(resolve, milliseconds);
    signal?.addEventListener(
      "abort",
      () => {
        clearTimeout(timer);
        reject(signal.reason);
      },
      { once: true },
    );
  });
}

/** Whether the error is that of a request that its caller has given up. */
export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

export class Api {
  key: string | null = null;
  /** Asks for a key; `refused` is the one that the daemon did not take. */
  declare onKeyNeeded: (refused: string | null) => Promise<string>;
  /** The daemon does not answer, or answers again. */
  declare onConnection: (isOnline: boolean) => void;
  /** The daemon refuses work for some seconds. */
  declare onBusy: (seconds: number) => void;

  #isOnline = true;
  #clock = 0; // milliseconds that the daemon's clock is before this one's

  /** Milliseconds since 1970 by the daemon's clock. */
  get now(): number {
    return Date.now() + this.#clock;
  }

  /**
   * The response, when it is a good one. Waits while the daemon does not answer or has no room, so
   * a request must be one that may be repeated, or `isOnce`. Throws Problem, or AbortError of
   * `signal`; the browser's error of a lost response if `isOnce`.
   */
  async request(path: string, ask: Ask = {}): Promise<Response> {
    for (const tries = { lost: 0, busy: 0 }; ;) {
      const key = this.key;
      let response: Response;
      try {
        response = await fetch(path, {
          method: ask.method ?? (ask.body ? "POST" : "GET"),
          headers: {
            ...(ask.body ? { "Content-Type": "application/json" } : {}),
            ...ask.headers,
            ...(key === null ? {} : { Authorization: `Bearer ${key}` }),
          },
          body: ask.body ? JSON.stringify(ask.body) : null,
          signal: (!ask.isWhole && ask.signal) || null,
          cache: "no-store",
          credentials: "omit",
        });
        const clock = Date.parse(response.headers.get("Date") ?? "") - Date.now();
        this.#clock = Math.abs(clock) > CLOCK_MS_MAX ? clock : 0;
        // A body that breaks off is asked for again.
        const body = ask.isStream ? null : await response.blob();
        if (body) response = new Response(body.size ? body : null, response);
      } catch (error) {
        if (ask.isOnce || isAbort(error) || ask.signal?.aborted) throw error;
        await this.#waitForDaemon(tries.lost++, ask.signal);
        continue;
      }
      if (response.ok) {
        this.#setOnline(true);
        return response;
      }
      const problem = problemOf(response.status, await response.text());
      if (ask.isOnce && problem.code === BAD_RESPONSE) throw problem; // a proxy lost the response
      await this.#overcome(problem, response.headers.get("Retry-After"), key, tries, ask.signal);
    }
  }

  // Waits for what a request was refused for, if that may change; else throws the problem.
  async #overcome(
    problem: Problem,
    retryAfter: string | null,
    key: string | null,
    tries: Tries,
    signal?: AbortSignal,
  ): Promise<void> {
    const { status } = problem;
    if (status === 401) return this.#renewKey(key);
    if (problem.code === "shutting-down") return this.#waitForDaemon(tries.lost++, signal);
    this.#setOnline(true);
    const isProxy = problem.code === BAD_RESPONSE && [502, 503, 504].includes(status);
    if ((status !== 429 && status !== 503 && !isProxy) || tries.busy++ >= BUSY_TRIES_MAX)
      throw problem;
    // A proxy tells no time, and what is behind it may be starting.
    const seconds = Math.min(30, Number(retryAfter) || (isProxy ? 2 ** (tries.busy - 1) : 1));
    this.onBusy(seconds);
    return pause(seconds * 1000, signal);
  }

  async json<T>(path: string, ask: Ask = {}): Promise<T> {
    return (await (await this.request(path, ask)).json()) as T;
  }

  /**
   * Sends a file; `onProgress` gets the bytes that the daemon has taken. Throws Problem, AbortError,
   * an error of the browser if the file has changed, and one after LOST_UPLOADS_MAX lost uploads.
   */
  async upload<T>(
    path: string,
    file: Blob,
    type: string,
    onProgress: (bytes: number) => void,
    signal?: AbortSignal,
  ): Promise<T> {
    for (let lost = 0, tries = { lost: 0, busy: 0 }; ;) {
      const key = this.key;
      const { status, text, retryAfter } = await this.#send(
        path,
        file,
        type,
        key,
        onProgress,
        signal,
      );
      if (status === 0) {
        await file.slice(0, 1).arrayBuffer(); // throws if the file has changed or is gone
        await this.request("/v1/me", { signal }); // waits until the daemon answers
        if (++lost >= LOST_UPLOADS_MAX) throw new Error(T.uploadLost);
      } else if (status >= 200 && status < 300) {
        this.#setOnline(true);
        return JSON.parse(text) as T;
      } else {
        await this.#overcome(problemOf(status, text), retryAfter, key, tries, signal);
      }
    }
  }

  /** The job's states as they come, until it has ended. Resumes where a stream broke. */
  async *events(job: string, signal: AbortSignal): AsyncGenerator<JobStatus> {
    for (let last = ""; ;) {
      const headers: Record<string, string> = last ? { "Last-Event-ID": last } : {};
      const ask = { headers, signal, isStream: true };
      const response = await this.request(`/v1/jobs/${job}/events`, ask);
      try {
        for await (const event of readEvents(response)) {
          last = event.id || last;
          const status = JSON.parse(event.data) as JobStatus;
          yield status;
          if (hasEnded(status)) return;
        }
      } catch (error) {
        if (isAbort(error) || signal.aborted) throw error;
      }
      // The stream broke: the job may have ended meanwhile.
      const status = await this.json<JobStatus>(`/v1/jobs/${job}`, { signal });
      yield status;
      if (hasEnded(status)) return;
      await pause(300, signal);
    }
  }

  #send(
    path: string,
    file: Blob,
    type: string,
    key: string | null,
    onProgress: (bytes: number) => void,
    signal?: AbortSignal,
  ): Promise<{ status: number; text: string; retryAfter: string | null }> {
    return new Promise((resolve, reject) => {
      if (signal?.aborted) return reject(signal.reason);
      const request = new XMLHttpRequest();
      request.open("POST", path);
      request.setRequestHeader("Content-Type", type);
      if (key !== null) request.setRequestHeader("Authorization", `Bearer ${key}`);
      request.upload.onprogress = event => onProgress(event.loaded);
      request.onloadend = () => {
        if (signal?.aborted) reject(signal.reason);
        else
          resolve({
            status: request.status,
            text: request.responseText,
            retryAfter: request.getResponseHeader("Retry-After"),
          });
      };
      signal?.addEventListener("abort", () => request.abort(), { once: true });
      request.send(file);
    });
  }

  #asking: Promise<void> | null = null;

  // One question at a time, however many requests were refused.
  #renewKey(refused: string | null): Promise<void> {
    if (this.key !== refused) return Promise.resolve(); // another request has asked meanwhile
    this.#asking ??= this.onKeyNeeded(refused)
      .then(key => {
        this.key = key;
      })
      .finally(() => {
        this.#asking = null;
      });
    return this.#asking;
  }

  async #waitForDaemon(tries: number, signal?: AbortSignal): Promise<void> {
    this.#setOnline(false);
    await pause(PAUSES_MS[Math.min(tries, PAUSES_MS.length - 1)] as number, signal);
  }

  #setOnline(isOnline: boolean): void {
    if (isOnline === this.#isOnline) return;
    this.#isOnline = isOnline;
    this.onConnection(isOnline);
    // Whoever asked may give up.
    if (!isOnline) this.request("/v1/me").catch(() => 0);
  }
}

function problemOf(status: number, text: string): Problem {
  try {
    return Problem.of(JSON.parse(text) as ErrorBody, status);
  } catch {
    return new Problem(status, BAD_RESPONSE, `HTTP ${status}`);
  }
}

/** The events of a text/event-stream (html.spec.whatwg.org, section 9.2.6). */
async function* readEvents(response: Response): AsyncGenerator<{ id: string; data: string }> {
  if (!response.body) return;
  const reader = response.body.pipeThrough(new TextDecoderStream()).getReader();
  try {
    for (let rest = ""; ;) {
      // A connection that is lost may never end by itself.
      const silence = setTimeout(() => void reader.cancel().catch(() => undefined), SILENCE_MS);
      const { value, done } = await reader.read().finally(() => clearTimeout(silence));
      if (done) return;
      const blocks = (rest + value).split("\n\n");
      rest = blocks.pop() ?? "";
      for (const block of blocks) {
        let id = "",
          data = "";
        for (const line of block.split("\n")) {
          if (line.startsWith("data:")) data += line.slice(5).trimStart();
          if (line.startsWith("id:")) id = line.slice(3).trim();
        }
        if (data) yield { id, data };
      }
    }
  } finally {
    void reader.cancel().catch(() => undefined);
  }
}
