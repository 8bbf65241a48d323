// Jobs of the page: a small one for the eye, then the one that is wanted. A newer wish supersedes
// the one before, whose job is cancelled.
import { isAbort, Problem, type Api } from "./api";
import { hasEnded, type DryRun, type JobStatus } from "./model";
import { hexOf } from "./texts";

export type Options = Readonly<Record<string, string | number | readonly string[]>>;

/** One wish: a mesh and the options of its voxels. */
export interface Wish {
  readonly asset: string;
  readonly filename: string;
  readonly options: Options;
}

export interface RunnerHooks {
  /** A job waits, runs or has ended; `preview`: the size of one for the eye, else 0. */
  onStatus(job: JobStatus, preview: number): void;
  /** A job was submitted, also one that is superseded already. */
  onJob(job: JobStatus): void;
  /** Grids to show: of an ended job, or of a sequence that has a new frame. */
  onGrid(job: JobStatus, preview: number): Promise<void>;
  /** Containers of the first tiles of the grid that is wanted, which is still being made. */
  onTiles(parts: readonly ArrayBuffer[]): Promise<void>;
  onProblem(error: unknown): void;
}

// Sizes of the previews before the job that is wanted, and the least seconds of a job that gets them.
const PREVIEWS = [
  [128, 0.25],
  [1024, 3],
] as const;
// Cells on a side of a grid that shows as it grows: all that a larger one would show is in its preview.
const GROWING_SIZE_MAX = 1024,
  GROWING_MS = 1000; // between requests for its tiles
const ANIMATION_OPTIONS = ["animation", "fps", "frames", "times", "root_motion"];

export class Runner {
  #running: AbortController | null = null;
  #active = ""; // id of a job that has not ended
  #pending: Promise<unknown> = Promise.resolve(); // requests for jobs and for their end

  constructor(
    private readonly api: Api,
    private readonly hooks: RunnerHooks,
  ) {}

  get isRunning(): boolean {
    return this.#running !== null;
  }

  /** The cost of the wish. Throws Problem, AbortError. */
  price(wish: Wish, signal: AbortSignal): Promise<DryRun> {
    return this.api.json<DryRun>("/v1/jobs?dry_run=1", { body: this.#body(wish), signal });
  }

  /** Runs the wish in place of the one before. The job, when it is done; null if it has failed or was superseded. */
  async run(wish: Wish, price: DryRun | null): Promise<JobStatus | null> {
    const stopped = this.stop();
    const running = (this.#running = new AbortController());
    try {
      await stopped;
      const previews = previewsOf(wish, price);
      for (const size of previews) await this.#preview(wish, size, running.signal);
      const grows = previews.length > 0 && Number(wish.options["size"]) <= GROWING_SIZE_MAX;
      const job = await this.#follow(this.#body(wish), 0, running.signal, grows);
      if (job.state === "failed") throw problemOf(job);
      return job.state === "done" && !running.signal.aborted ? job : null;
    } catch (error) {
      if (!isAbort(error) && !running.signal.aborted) this.hooks.onProblem(error);
    } finally {
      if (this.#running === running) this.#running = null;
    }
    return null;
  }

  /** Cancels what runs. Waits for the requests of earlier calls, too. */
  async stop(): Promise<void> {
    const job = this.#active;
    this.#running?.abort();
    this.#running = null;
    this.#active = "";
    const cancelled = job && this.#cancel(job);
    if (cancelled) this.#waitFor(cancelled);
    const status = await cancelled;
    if (status) this.hooks.onStatus({ ...status, state: "cancelled" }, 0);
    await this.#pending;
  }

  /** Submits another kind of job and waits for its end. The signal cancels it; stop() waits for that. */
  async other(body: object, signal: AbortSignal): Promise<JobStatus> {
    let job = await this.#submit(body, signal);
    if (!hasEnded(job)) {
      signal.addEventListener("abort", () => hasEnded(job) || this.#waitFor(this.#cancel(job.id)));
      for await (const status of this.api.events(job.id, signal)) job = status;
    }
    if (job.state !== "done") throw problemOf(job);
    return job;
  }

  #body(wish: Wish): object {
    return { kind: "voxelize", asset: wish.asset, filename: wish.filename, options: wish.options };
  }

  // A request that is under way is not cut off: its job could not be cancelled.
  async #submit(body: object, signal: AbortSignal): Promise<JobStatus> {
    signal.throwIfAborted();
    const headers = { "Idempotency-Key": hexOf(crypto.getRandomValues(new Uint8Array(16))) };
    const submitted = this.api
      .json<JobStatus>("/v1/jobs", { body, headers, signal, isWhole: true })
      .then(async job => {
        this.hooks.onJob(job);
        if (signal.aborted) await this.#cancel(job.id);
        return job;
      });
    this.#waitFor(submitted);
    const job = await submitted;
    signal.throwIfAborted();
    return job;
  }

  // For stop().
  #waitFor(request: Promise<unknown>): void {
    this.#pending = Promise.allSettled([this.#pending, request]).then(() => undefined);
  }

  // The job's status; null if there is none.
  #cancel(job: string): Promise<JobStatus | null> {
    const path = `/v1/jobs/${job}`;
    return this.api.json<JobStatus>(path, { method: "DELETE" }).catch(ignoreProblem);
  }

  // Ignores a failed preview; the requested job reports the error.
  async #preview(wish: Wish, size: number, signal: AbortSignal): Promise<void> {
    let options: Record<string, unknown> = { ...wish.options, size };
    if (isSequence(wish.options)) {
      const kept = Object.entries(options).filter(([name]) => !ANIMATION_OPTIONS.includes(name));
      options = { ...Object.fromEntries(kept), animation: wish.options["animation"], time: 0 };
    }
    const body = { ...this.#body(wish), options, priority: 10 };
    await this.#follow(body, size, signal).catch(ignoreProblem);
  }

  // A grid that cannot be shown can be taken home all the same.
  async #shown(showing: Promise<void>): Promise<void> {
    try {
      await showing;
    } catch (error) {
      if (isAbort(error)) throw error;
      this.hooks.onProblem(error);
    }
  }

  // Submits a job and shows its states and grids until it has ended.
  async #follow(
    body: object,
    preview: number,
    signal: AbortSignal,
    grows = false,
  ): Promise<JobStatus> {
    let job = await this.#submit(body, signal);
    let framesShown = 0;
    const tiles: ArrayBuffer[] = [];
    let shown = 0,
      due = 0;
    const grow = async () => {
      if (!grows || job.tiles_done <= shown || performance.now() < due) return;
      due = performance.now() + GROWING_MS;
      const path = `/v1/jobs/${job.id}/tiles?after=${shown}`;
      const response = await this.api.request(path, { signal }).catch(ignoreProblem);
      if (response?.status !== 200) return; // there are no others yet
      shown = Number(response.headers.get("X-Voxeld-Next"));
      tiles.push(await response.arrayBuffer());
      await this.#shown(this.hooks.onTiles(tiles));
    };
    const show = async () => {
      signal.throwIfAborted();
      this.#active = hasEnded(job) ? "" : job.id;
      this.hooks.onStatus(job, preview);
      if (hasEnded(job)) return;
      if (job.frames_done > framesShown) {
        framesShown = job.frames_done;
        await this.#shown(this.hooks.onGrid(job, preview));
      } else {
        await grow();
      }
    };
    await show();
    if (!hasEnded(job)) {
      for await (job of this.api.events(job.id, signal)) await show();
    }
    if (job.state === "done") {
      job = await this.api.json<JobStatus>(`/v1/jobs/${job.id}`, { signal }); // with all of its meta
      await this.#shown(this.hooks.onGrid(job, preview));
      if (!signal.aborted) this.hooks.onStatus(job, preview);
    }
    return job;
  }
}

function ignoreProblem(error: unknown): null {
  if (error instanceof Problem) return null;
  throw error;
}

function problemOf({ error, state }: JobStatus): Problem {
  return Problem.of(error ?? { code: state, detail: state });
}

// The sizes of the previews that the wish is worth.
function previewsOf({ options }: Wish, price: DryRun | null): number[] {
  if (price?.cached) return [];
  const seconds = price?.estimate.seconds ?? Infinity;
  const sizes = PREVIEWS.filter(([, least]) => seconds >= least).map(([size]) => size);
  return isSequence(options)
    ? sizes.slice(0, 1)
    : sizes.filter(size => size < Number(options["size"]));
}

/** Whether voxels of these options are a grid for each frame of an animation. */
export function isSequence(options: Options): boolean {
  return options["animation"] !== undefined && options["time"] === undefined;
}
