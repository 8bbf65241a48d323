// Downloads: files, images, links, commands.
import { isAbort, type Api } from "./api";
import { cliCommand, cppCode, curlCommand, pythonCode, type Recipe } from "./commands";
import { field, fill, followLink, h, saveBlob, select } from "./dom";
import { formatOf, formats, optionText, type OutputFormat } from "./formats";
import type { DryRun, JobStatus } from "./model";
import { viewOptions } from "./picture";
import type { Options, Runner, Wish } from "./runner";
import type { Stage } from "./stage";
import { bytesText, t, T } from "./texts";

/** The result that is taken home. */
export interface Source {
  readonly job: JobStatus;
  readonly wish: Wish;
  readonly stem: string; // of names of files
  readonly files: readonly string[]; // names of the mesh and the files beside it
}

const HOUR_SECONDS = 3600;
const LIFETIMES = [
  [T.hour, 1],
  [T.day, 24],
  [T.week, 168],
  [T.month, 720],
] as const;
const TURNTABLE = { turntable: 36, rate: 18, width: 400, height: 400 };
const IMAGE_SIDE_MAX = 4096;

/** An input for a side of an image. */
function side(label: string, value: number): HTMLInputElement {
  return h("input", { type: "number", min: 1, max: IMAGE_SIDE_MAX, value, "aria-label": label });
}

export class Take {
  declare onProblem: (error: unknown) => void;
  declare onNote: (text: string) => void;

  #source: Source | null = null;
  #format: OutputFormat = formats[0] as OutputFormat;
  #values: Record<string, string | number> = {};
  #asking: AbortController | null = null;
  #busy = new AbortController(); // ends what is made of the mesh
  readonly #optionFields = h("div", { className: "stack" });
  readonly #size = h("span", { className: "quiet" });
  readonly #download = h(
    "button",
    { className: "primary", onclick: () => this.#guard(signal => this.#takeFile(signal)) },
    T.download,
  );
  readonly #width = side(T.width, 1600);
  readonly #height = side(T.height, 1200);
  readonly #transparent = h("input", { type: "checkbox" });
  readonly #gif = h(
    "button",
    { onclick: () => this.#guard(signal => this.#takeGif(signal)) },
    T.gif,
  );
  readonly #lifetime = select(
    LIFETIMES.map(([text, hours]) => [String(hours * HOUR_SECONDS), text]),
    String(24 * HOUR_SECONDS),
    () => undefined,
  );
  readonly #link = h("input", { readOnly: true, "aria-label": T.share });
  readonly #linkRow = h("div", { className: "row", hidden: true });
  readonly #linkNote = h("p", { className: "note", hidden: true });
  readonly #code = h("pre", { tabIndex: 0, role: "group", "aria-label": T.copyAs });
  #language: "curl" | "cli" | "python" | "cpp" = "curl";

  constructor(
    parent: HTMLElement,
    private readonly api: Api,
    private readonly runner: Runner,
    private readonly stage: Stage,
  ) {
    const formatSelect = select(
      formats.map(({ name, text, extension, group }) => [name, `${text} (${extension})`, group]),
      this.#format.name,
      value => this.#choose(value),
    );
    formatSelect.id = "format";
    this.#lifetime.setAttribute("aria-label", T.shareFor);
    this.#linkRow.append(
      this.#link,
      h("button", { onclick: () => this.#copy(this.#link.value) }, T.copy),
    );
    parent.append(
      field(T.format, formatSelect),
      this.#optionFields,
      h("div", { className: "row" }, this.#download, this.#size),
      h(
        "div",
        { className: "row" },
        h("button", { onclick: () => this.#guard(signal => this.#share(signal)) }, T.share),
        h("span", { className: "quiet" }, T.shareFor),
        this.#lifetime,
      ),
      this.#linkRow,
      this.#linkNote,
      this.#pictures(),
      this.#commands(),
    );
    this.#choose(this.#format.name);
  }

  /** Nothing can be taken until the next result is there; what is under way goes on. */
  hold(): void {
    this.#source = null;
    this.#refresh();
  }

  /** Sets the source of all files; null: nothing can be taken, and what is under way ends. */
  show(source: Source | null): void {
    this.#source = source;
    if (!source) {
      this.#busy.abort();
      this.#busy = new AbortController();
    }
    this.#linkRow.hidden = this.#linkNote.hidden = true;
    this.#gif.textContent = source?.job.result?.sequence ? T.gifFrames : T.gif;
    if (source && this.#format.options.some(({ name }) => name === "channel")) {
      this.#choose(this.#format.name);
    } else {
      this.#refresh();
    }
  }

  #pictures(): HTMLElement {
    return h(
      "details",
      { id: "pictures" },
      h("summary", {}, T.picture),
      h(
        "div",
        { className: "row" },
        this.#width,
        h("span", { "aria-hidden": "true" }, "×"),
        this.#height,
        h("label", { className: "check" }, this.#transparent, T.transparent),
      ),
      h(
        "div",
        { className: "row" },
        h(
          "button",
          { id: "png", onclick: () => this.#guard(signal => this.#takePng(signal)) },
          T.png,
        ),
        this.#gif,
      ),
    );
  }

  #commands(): HTMLElement {
    const languages = [
      ["curl", "curl"],
      ["cli", "CLI"],
      ["python", "Python"],
      ["cpp", "C++"],
    ] as const;
    const tabs = languages.map(([language, text]) =>
      h(
        "button",
        {
          "aria-pressed": String(language === this.#language),
          onclick: () => {
            this.#language = language;
            tabs.forEach((tab, i) =>
              tab.setAttribute("aria-pressed", String(languages[i]?.[0] === language)),
            );
            this.#showCode();
          },
        },
        text,
      ),
    );
    return h(
      "details",
      { id: "commands" },
      h("summary", {}, T.copyAs),
      h(
        "div",
        { className: "row tabs" },
        ...tabs,
        h(
          "button",
          { className: "end", onclick: () => this.#copy(this.#code.textContent ?? "") },
          T.copy,
        ),
      ),
      this.#code,
    );
  }

  // Options stay as they are where the format has them, and the grid once it is there.
  #choose(name: string): void {
    this.#format = formatOf(name);
    const before = this.#values,
      channels = this.#source?.job.result?.meta?.channels ?? [before["channel"]];
    this.#values = {};
    fill(
      this.#optionFields,
      ...this.#format.options.map(option => {
        const { name, range } = option,
          kept = before[name];
        const values = option.values.filter(
          (value, i) => i === 0 || name !== "channel" || channels.includes(value),
        );
        if (range ? Number(kept) > 0 : values.includes(String(kept)))
          this.#values[name] = kept!;
        const byDefault = range ? range[2] : (values[0] as string),
          value = this.#values[name] ?? byDefault;
        const set = (value: string | number) => {
          if (value === byDefault) delete this.#values[name];
          else this.#values[name] = value;
          this.#refresh();
        };
        const input = range
          ? h("input", {
              type: "number",
              min: range[0],
              max: range[1],
              value,
              onchange: () => {
                input.value ||= String(byDefault);
                set(Number(input.value));
              },
            })
          : select(
              values.map(value => [value, value]),
              String(value),
              set,
            );
        return field(optionText(option), input);
      }),
    );
    this.#refresh();
  }

  get #output(): Options {
    return { format: this.#format.name, ...this.#values };
  }
  get #name(): string {
    const isSequence = "sequence" in this.#input;
    const extension =
      !isSequence || ["npy", "npz", "vox", "zarr"].includes(this.#format.name)
        ? this.#format.extension
        : this.#format.name === "native"
          ? ".voxs"
          : ".zip";
    return this.#source!.stem + extension;
  }
  get #input(): Record<string, string> {
    const { grid, sequence } = this.#source!.job.result!;
    return sequence ? { sequence } : { grid };
  }

  // The size is the daemon's estimate for an export.
  #refresh(): void {
    this.#showCode();
    this.#asking?.abort();
    this.#size.textContent = "";
    this.#download.disabled = !this.#source;
    if (!this.#source) return;
    const asking = (this.#asking = new AbortController());
    this.api
      .json<DryRun>("/v1/jobs?dry_run=1", {
        body: { kind: "export", ...this.#input, options: this.#output },
        signal: asking.signal,
      })
      .then(
        price => {
          this.#size.textContent = t(T.downloadSize, {
            bytes: bytesText(price.estimate.result_bytes),
          });
          this.#size.className = "quiet";
        },
        (error: unknown) => {
          if (isAbort(error)) return;
          this.#size.textContent = (error as Error).message; // such as grid-too-large
          this.#size.className = "error";
        },
      );
  }

  async #guard(action: (signal: AbortSignal) => Promise<void>): Promise<void> {
    if (!this.#source) return;
    try {
      await action(this.#busy.signal);
    } catch (error) {
      if (!isAbort(error)) this.onProblem(error);
    }
  }

  // The result of an export, or the job's own where it is that; or of another kind of job.
  #made(
    name: string,
    signal: AbortSignal,
    kind = "export",
    options = this.#output,
  ): Promise<JobStatus> {
    this.onNote(t(T.preparing, { name }));
    return this.runner.other(
      { kind, ...this.#input, filename: this.#source!.stem, options, priority: 10 },
      signal,
    );
  }

  #linkOf(
    job: JobStatus,
    seconds: number,
    name: string,
    signal: AbortSignal,
  ): Promise<{ url: string; expires_ms: number }> {
    const query = new URLSearchParams({ seconds: String(seconds), filename: name });
    return this.api.json(`/v1/jobs/${job.id}/share?${query}`, { method: "POST", signal });
  }

  async #takeFile(
    signal: AbortSignal,
    name = this.#name,
    kind?: string,
    options?: Options,
  ): Promise<void> {
    const job = await this.#made(name, signal, kind, options);
    // By a link, so that the browser writes to the disk and not into memory.
    followLink((await this.#linkOf(job, HOUR_SECONDS, name, signal)).url);
    this.onNote(t(T.downloaded, { name, bytes: bytesText(job.result?.bytes ?? 0) }));
  }

  async #share(signal: AbortSignal): Promise<void> {
    const source = this.#source,
      name = this.#name,
      job = await this.#made(name, signal);
    const link = await this.#linkOf(job, Number(this.#lifetime.value), name, signal);
    if (this.#source !== source) return; // another result has come
    this.#link.value = new URL(link.url, location.href).href;
    this.#linkRow.hidden = this.#linkNote.hidden = false;
    this.#linkNote.textContent = t(T.shared, { date: new Date(link.expires_ms).toLocaleString() });
    this.#link.select();
    this.onNote(this.#linkNote.textContent);
  }

  async #takePng(signal: AbortSignal): Promise<void> {
    const side = (input: HTMLInputElement) =>
      Math.max(1, Math.min(IMAGE_SIDE_MAX, Math.round(Number(input.value)) || 512));
    const [width, height] = [side(this.#width), side(this.#height)];
    const name = `${this.#source?.stem}.png`;
    this.onNote(t(T.preparing, { name }));
    const { camera, channel, style, section, viewer } = this.stage;
    let blob: Blob;
    // The daemon has no pan and no channels, and fits its camera to a region.
    if (viewer && (channel || section.box || camera.pan.some(value => value !== 0))) {
      blob = await viewer.image(width, height, this.#transparent.checked);
    } else {
      // A grid that could not be shown has its picture all the same.
      const { grid, sequence } = this.#source?.job.result ?? {};
      const path = grid && !sequence ? `/v1/grids/${grid}` : this.stage.path;
      const query = new URLSearchParams({
        width: String(width),
        height: String(height),
        ...viewOptions(camera, style, section),
        ...(this.#transparent.checked ? { background: "transparent" } : {}),
      });
      blob = await (
        await this.api.request(`${path}/render.png?${query}`, { signal })
      ).blob();
    }
    saveBlob(blob, name);
    this.onNote(t(T.downloaded, { name, bytes: bytesText(blob.size) }));
  }

  // The cells that the box leaves, if the viewer shows the source; else all.
  get #region(): Options {
    const { section, path, region, viewer } = this.stage,
      source = this.#input["grid"] ?? this.#source!.job.id;
    if (!viewer || !section.box || !path.includes(source)) return {};
    const [low, high] = region;
    if (low.some((cells, c) => cells >= high[c]!)) throw new Error(T.boxEmpty);
    return { region: region.join() };
  }

  #takeGif(signal: AbortSignal): Promise<void> {
    const { camera, style, section } = this.stage;
    const { turntable, rate, ...size } = TURNTABLE;
    return this.#takeFile(signal, `${this.#source?.stem}.gif`, "render", {
      image: "gif",
      ...size,
      ...("sequence" in this.#input ? {} : { turntable, rate }),
      ...viewOptions(camera, style, section),
      ...this.#region,
    });
  }

  #showCode(): void {
    const source = this.#source;
    if (!source) {
      this.#code.textContent = "";
      return;
    }
    const recipe: Recipe = {
      origin: location.origin,
      hasKey: this.api.key !== null,
      file: source.files[0]!,
      others: source.files.slice(1),
      options: source.wish.options,
      output: this.#output,
      target: (source.files.includes(this.#name) ? "voxels-" : "") + this.#name, // no input is lost
    };
    const make = { curl: curlCommand, cli: cliCommand, python: pythonCode, cpp: cppCode }[
      this.#language
    ];
    this.#code.textContent = make(recipe);
  }

  async #copy(text: string): Promise<void> {
    try {
      await navigator.clipboard.writeText(text);
    } catch {
      // no permission, or plain HTTP
      const area = h("textarea", { value: text, className: "away" });
      document.body.append(area);
      area.select();
      document.execCommand("copy");
      area.remove();
    }
    this.onNote(T.copied);
  }
}
