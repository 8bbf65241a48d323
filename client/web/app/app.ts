// The view that voxelizes: from files to an asset, to voxels, to what is taken home.
import { isAbort, Problem, type Api } from "./api";
import { byId, fill, h } from "./dom";
import {
  bundleOf,
  extended,
  filesOfInput,
  filesOfTransfer,
  stemOf,
  type Bundle,
  type NamedFile,
} from "./files";
import { Look } from "./look";
import type { Asset, AssetDescription, DryRun, GridMeta, JobStatus } from "./model";
import { hasEnded } from "./model";
import { Runner, type Wish } from "./runner";
import { priceText, Settings } from "./settings";
import { Stage, type Shown } from "./stage";
import { showStart } from "./start";
import { Take } from "./take";
import { bytesText, count, duration, progressOf, t, T } from "./texts";
import { Timeline } from "./timeline";
import { uploadBundle } from "./upload";

const PRICE_DELAY_MS = 140; // after a change of the settings
const RUN_DELAY_MS = 350;
const AUTO_SECONDS_MAX = 8; // jobs that are expected to take longer wait for a click
const CANCEL_MS_MAX = 60_000; // a job that is cancelled has ended by then
// Formats that may have animations: their description decides the options of the first job.
const MAY_MOVE = /\.(gltf|glb|md5mesh|zip)$/i;

export class App {
  #bundle: Bundle | null = null;
  #asset: Asset | null = null;
  #assets: string[] = []; // all that was made of the mesh's files
  #jobs = new Set<string>(); // whose results are deleted with them
  #removing = Promise.resolve(); // a deletion that may be under way
  #given = 0; // drops, pastes, choices and samples so far
  #loaded = 0; // the latest of them that had a mesh
  #loading: AbortController | null = null;
  #pricing: AbortController | null = null;
  #timer = 0;
  #keepCamera = false;
  #shownJob = ""; // of the frames that the timeline shows
  #meta: GridMeta = {}; // of the grid that came last

  readonly #stage: Stage;
  readonly #runner: Runner;
  readonly #settings: Settings;
  readonly #look: Look;
  readonly #take: Take;
  readonly #timeline: Timeline;
  readonly #panel = byId("panel");
  readonly #over = byId("over");
  readonly #facts = byId("facts");
  readonly #title = h("h2");
  readonly #description = h("ul", { className: "facts" });
  readonly #missing = h("p", { className: "note warn", hidden: true });
  readonly #priceLine = h("p", { className: "quiet price", id: "price", "aria-live": "polite" });
  readonly #runButton = h(
    "button",
    { className: "primary", id: "run", onclick: () => this.#run() },
    T.run,
  );
  readonly #cancelButton = h(
    "button",
    { id: "cancel", hidden: true, onclick: () => this.#cancel() },
    T.cancel,
  );
  readonly #progress = h("progress", { hidden: true, "aria-label": T.progress });
  readonly #jobLine = h("p", { id: "job", "aria-live": "polite" });

  constructor(
    private readonly api: Api,
    private readonly onProblem: (error: unknown) => void,
    private readonly onNote: (text: string) => void,
  ) {
    const canvas = byId<HTMLCanvasElement>("canvas"),
      image = byId<HTMLImageElement>("picture");
    const wantsViewer = !new URLSearchParams(location.search).has("pictures");
    this.#stage = new Stage(
      canvas,
      image,
      api,
      byId<HTMLMetaElement>("worker").content,
      wantsViewer,
    );
    this.#stage.onProblem = onProblem;
    this.#stage.onLost = () => {
      onNote(T.lost);
      this.#look.show();
    };
    canvas.setAttribute("aria-label", T.viewHelp);
    image.alt = T.viewHelp;
    this.#runner = new Runner(api, {
      onStatus: (job, preview) => this.#showJob(job, preview),
      onGrid: (job, preview) => this.#showGrid(job, preview),
      onJob: job => this.#jobs.add(job.id),
      onTiles: parts => this.#grow(parts),
      onProblem,
    });
    this.#timeline = new Timeline(byId("timeline"), {
      show: frame => this.#show(this.#frame(frame)),
      prefetch: frame => this.#stage.prefetch(this.#frame(frame)),
      onProblem,
    });
    const cards = [
      ["model", ""],
      ["voxels", T.voxels],
      ["look", T.look],
      ["take", T.take],
    ] as const;
    const [model, voxels, look, take] = cards.map(([name, title]) => {
      const card = h(
        "section",
        { className: "card", id: `card-${name}`, "aria-labelledby": `title-${name}` },
        name === "model" ? this.#title : h("h2", {}, title),
      );
      (card.firstElementChild as HTMLElement).id = `title-${name}`;
      return card;
    }) as [HTMLElement, HTMLElement, HTMLElement, HTMLElement];
    this.#panel.append(model, voxels, look, take);
    model.append(
      this.#description,
      this.#missing,
      h(
        "div",
        { className: "row" },
        h("button", { id: "new", onclick: () => this.#close() }, T.newMesh),
        h(
          "button",
          { id: "delete", className: "danger", onclick: () => this.#remove() },
          T.remove,
        ),
      ),
    );
    this.#settings = new Settings(voxels);
    this.#settings.onChange = isFinal => this.#changed(isFinal);
    // The price may take more lines when it comes, and must not move the buttons under a click.
    voxels.append(
      h("div", { className: "row" }, this.#runButton, this.#cancelButton),
      this.#priceLine,
      this.#progress,
      this.#jobLine,
    );
    this.#look = new Look(look, this.#stage, byId("pick"), canvas);
    if (!this.#stage.viewer) look.append(h("p", { className: "note" }, T.still));
    this.#take = new Take(take, api, this.#runner, this.#stage);
    this.#take.onProblem = onProblem;
    this.#take.onNote = onNote;
    showStart(files => void this.load(files), onProblem);
    this.#listen();
  }

  // Files from anywhere on the page.
  #listen(): void {
    let depth = 0; // dragenter and dragleave come for each element
    const isFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;
    const mark = (by: number) => {
      depth = Math.max(0, depth + by);
      document.body.classList.toggle("dragging", depth > 0);
    };
    document.ondragenter = event => {
      if (isFiles(event)) mark(1);
    };
    document.ondragleave = event => {
      if (isFiles(event)) mark(-1);
    };
    document.ondragover = event => event.preventDefault();
    document.ondrop = event => {
      event.preventDefault();
      depth = 0;
      mark(0);
      if (event.dataTransfer) this.#transfer(event.dataTransfer);
    };
    document.onpaste = event => {
      if (event.clipboardData && event.clipboardData.files.length > 0)
        this.#transfer(event.clipboardData);
    };
    for (const id of ["files", "folder"]) {
      const input = byId<HTMLInputElement>(id);
      input.onchange = () => {
        void this.load(filesOfInput(input));
        input.value = "";
      };
    }
  }

  #transfer(data: DataTransfer): void {
    const turn = ++this.#given;
    filesOfTransfer(data)
      .then(files => this.load(files, turn))
      .catch(this.onProblem);
  }

  /** Uploads the files and voxelizes their mesh, unless that of a later turn was read before. */
  async load(files: readonly NamedFile[], turn = ++this.#given): Promise<void> {
    if (files.length === 0) return;
    const own = bundleOf(files),
      bundle = own ?? (this.#bundle && extended(this.#bundle, files));
    if (!bundle) {
      this.onProblem(
        new Error(
          t(T.noMesh, {
            names: files
              .slice(0, 5)
              .map(file => file.name)
              .join(", "),
          }),
        ),
      );
      return;
    }
    if (turn < this.#loaded) return;
    if (own) this.#loaded = turn; // files for one mesh add up, in any order
    if (bundle.ignored > 0) this.onNote(t(T.ignored, { n: bundle.ignored }));
    this.#loading?.abort();
    this.#pricing?.abort();
    const loading = (this.#loading = new AbortController());
    const before = own ? null : this.#bundle; // without the files that are added
    const ask = (event: Event) => event.preventDefault();
    try {
      await this.#runner.stop();
      if (loading.signal.aborted) return; // another mesh has come
      this.#begin(bundle);
      this.#showOver(t(T.hashing, { name: bundle.mesh.name }));
      await this.#removing; // maybe of the same mesh
      loading.signal.throwIfAborted();
      addEventListener("beforeunload", ask); // an upload would be lost
      this.#asset = await uploadBundle(
        this.api,
        bundle,
        (text, share, isKnown) => {
          this.#showOver(text, share);
          if (isKnown) this.onNote(text);
        },
        id => this.#assets.push(id),
        loading.signal,
      ).finally(() => removeEventListener("beforeunload", ask));
      this.#showOver("");
      await this.#describe(this.#asset, bundle, loading.signal);
    } catch (error) {
      if (this.#loading !== loading) return; // another mesh has come
      this.#showOver("");
      if (!this.#asset) {
        if (before && !isAbort(error)) await this.load(before.files);
        else this.#close();
      }
      if (!isAbort(error)) this.onProblem(error);
    }
  }

  #begin(bundle: Bundle): void {
    if (bundle.mesh.blob !== this.#bundle?.mesh.blob) {
      this.#jobs = new Set();
      this.#assets = [];
    }
    this.#bundle = bundle;
    this.#asset = null;
    this.#keepCamera = false;
    this.#clear();
    this.#look.forget();
    this.#settings.reset();
    byId("banner").hidden = true;
    const view = byId("view");
    if (view.contains(document.activeElement)) view.focus(); // before its children vanish
    byId("start").hidden = true;
    this.#panel.hidden = false;
    document.body.classList.add("open");
    this.#title.textContent = stemOf(bundle.mesh.name);
    fill(this.#description);
    this.#missing.hidden = true;
    this.#jobLine.textContent = this.#priceLine.textContent = "";
  }

  async #describe(asset: Asset, bundle: Bundle, signal: AbortSignal): Promise<void> {
    const described = this.api.json<AssetDescription>(`/v1/assets/${asset.id}`, { signal });
    const mayMove = MAY_MOVE.test(bundle.mesh.name);
    // A still mesh is voxelized while it is described.
    const first = mayMove ? null : this.#runIfQuick(0);
    try {
      const description = await described;
      this.#settings.describe(description);
      this.#showDescription(description);
      if (mayMove) void this.#runIfQuick(0);
    } catch (error) {
      await first;
      throw error;
    }
  }

  #showDescription(mesh: AssetDescription): void {
    const textures = new Set(mesh.materials.flatMap(({ texture }) => texture ?? [])).size;
    const animations = mesh.animations?.length ?? 0,
      parts = mesh.part_count ?? 0;
    const facts = [
      `${mesh.format.toUpperCase()}, ${bytesText(this.#bundle?.files.reduce((sum, file) => sum + file.blob.size, 0) ?? mesh.bytes)}`,
      mesh.voxels
        ? t(T.done, { voxels: count(mesh.voxels.voxel_count), dims: mesh.voxels.dims.join(" × ") })
        : t(T.triangles, { n: count(mesh.triangles) }),
      parts > 1 && t(T.parts, { n: count(parts) }),
      textures > 0
        ? textures === 1
          ? T.oneTexture
          : t(T.textures, { n: textures })
        : (mesh.has_colors ? T.vertexColors : T.noColors),
      animations > 0 && (animations === 1 ? T.oneAnimation : t(T.animations, { n: animations })),
      mesh.watertight === true && !mesh.voxels
        ? T.watertight
        : mesh.watertight === false &&
          t(T.notWatertight, { n: count((mesh.open_edges ?? 0) + (mesh.non_manifold_edges ?? 0)) }),
    ];
    fill(this.#description, ...facts.map(fact => fact && h("li", {}, fact)));
    this.#missing.hidden = mesh.missing_files.length === 0;
    this.#missing.textContent = t(T.missing, {
      names: mesh.missing_files.map(file => file.name).join(", "),
    });
  }

  get #wish(): Wish | null {
    return this.#asset && this.#bundle
      ? { asset: this.#asset.id, filename: this.#nameOfMesh, options: this.#settings.options }
      : null;
  }
  get #nameOfMesh(): string {
    const bundle = this.#bundle as Bundle;
    return bundle.files.length > 1 ? `${stemOf(bundle.mesh.name)}.bundle.json` : bundle.mesh.name;
  }

  // A change of the settings: what is under way is superseded. A quick job follows by itself.
  #changed(isFinal: boolean): void {
    if (!this.#asset) return;
    clearTimeout(this.#timer);
    this.#pricing?.abort();
    if (this.#runner.isRunning) void this.#cancel();
    this.#timer = setTimeout(
      () => void this.#runIfQuick(isFinal ? 0 : RUN_DELAY_MS),
      PRICE_DELAY_MS,
    );
  }

  // What takes longer starts by a click.
  async #runIfQuick(delayMs: number): Promise<void> {
    const price = await this.#askPrice();
    if (!price || (!price.cached && price.estimate.seconds > AUTO_SECONDS_MAX)) return;
    this.#timer = setTimeout(() => void this.#run(), delayMs);
  }

  async #askPrice(): Promise<DryRun | null> {
    const wish = this.#wish;
    if (!wish) return null;
    this.#pricing?.abort();
    const pricing = (this.#pricing = new AbortController());
    try {
      const price = await this.#runner.price(wish, pricing.signal);
      pricing.signal.throwIfAborted();
      this.#priceLine.textContent = priceText(price, this.api.now);
      this.#priceLine.classList.remove("error");
      return price;
    } catch (error) {
      if (isAbort(error)) return null;
      this.#priceLine.textContent = (error as Error).message;
      this.#priceLine.classList.add("error");
      this.onProblem(error);
      return null;
    }
  }

  async #run(): Promise<void> {
    clearTimeout(this.#timer);
    const price = await this.#askPrice();
    const wish = this.#wish;
    if (!price || !wish) return;
    const job = await this.#runner.run(wish, price);
    this.#showIdle();
    if (job) {
      this.#take.show({
        job,
        wish,
        stem: stemOf(this.#nameOfMesh),
        files: (this.#bundle as Bundle).files.map(file => file.name),
      });
    }
  }

  async #cancel(): Promise<void> {
    clearTimeout(this.#timer);
    this.#pricing?.abort(); // of a run that would begin later
    try {
      await this.#runner.stop();
    } catch (error) {
      if (!isAbort(error)) this.onProblem(error);
    }
    this.#showIdle();
    this.#jobLine.textContent = T.cancelled;
  }

  #showIdle(): void {
    if (this.#runner.isRunning) return;
    this.#cancelButton.hidden = this.#progress.hidden = true;
    this.#showOver("");
  }

  #showJob(job: JobStatus, preview: number): void {
    const isLive = !hasEnded(job);
    this.#cancelButton.hidden = this.#progress.hidden = !isLive && !preview;
    const [done, total] =
      job.frames_total > 0
        ? [job.frames_done, job.frames_total]
        : [job.tiles_done, job.tiles_total];
    if (isLive && total > 0) {
      this.#progress.max = total;
      this.#progress.value = done;
    } else {
      this.#progress.removeAttribute("value");
    }
    this.#jobLine.textContent = preview ? t(T.preview, { n: preview }) : this.#jobText(job);
  }

  #jobText(job: JobStatus): string {
    if (job.state === "cancelled") return T.cancelled;
    if (hasEnded(job)) return job.result?.warnings.map(({ detail }) => detail).join(" · ") ?? "";
    const text = progressOf(job),
      left = ((job.expected_end_ms ?? 0) - this.api.now) / 1000;
    if (job.state !== "running" || left <= 1) return text;
    return `${text}; ${t(T.endsIn, { time: duration(left) })}`;
  }

  async #showGrid(job: JobStatus, preview: number): Promise<void> {
    const meta = job.result?.meta ?? {},
      asset = this.#asset;
    this.#take.hold(); // it has the grid that was shown before
    const isMoving = !preview && (job.frames_total > 0 || Boolean(job.result?.sequence));
    this.#meta = meta;
    if (isMoving) {
      const isNew = this.#shownJob !== job.id;
      this.#shownJob = job.id;
      this.#timeline.show(
        job.frames_done,
        job.frames_total,
        meta.fps || Number(this.#settings.options["fps"]) || 24,
      );
      if (isNew || job.state === "done") await this.#show(this.#frame(this.#timeline.current));
    } else {
      this.#timeline.show(0, 0, 1);
      if (!this.#stage.path && this.#stage.viewer) this.#showOver(T.fetching);
      await this.#show({ path: `/v1/grids/${job.result?.grid ?? ""}`, meta });
    }
    if (this.#asset !== asset || this.#meta !== meta) return; // it is another grid's turn
    this.#showOver("");
    this.#showFacts(meta, preview);
  }

  // The grid itself reports errors, when it is there.
  async #grow(parts: readonly ArrayBuffer[]): Promise<void> {
    try {
      const grid = await this.#stage.grow(parts);
      if (!grid) return;
      this.#take.hold();
      this.#look.show({ ...this.#meta, dims: grid.dims, voxel_size: grid.voxelSize });
    } catch (error) {
      if (!isAbort(error) && (error as Error).name !== "DecodeError") throw error;
    }
  }

  #frame(frame: number): Shown {
    return { path: `/v1/jobs/${this.#shownJob}/frames/${frame}`, meta: this.#meta };
  }

  async #show(shown: Shown): Promise<void> {
    try {
      await this.#stage.show(shown, this.#keepCamera);
      this.#keepCamera = true;
      document.body.classList.add("shown");
      this.#look.show(shown.meta);
    } catch (error) {
      if (!isAbort(error)) throw error;
    }
  }

  #showFacts(meta: GridMeta, preview: number): void {
    const dims = meta.dims;
    this.#facts.hidden = !dims;
    if (!dims) return;
    const { level } = this.#stage;
    const places = { voxels: count(meta.voxel_count ?? 0), dims: dims.join(" × ") };
    this.#facts.textContent =
      t(meta.voxel_count === undefined ? T.doneFrames : T.done, places) +
      (preview
        ? ` · ${t(T.preview, { n: preview })}`
        : level > 0
          ? ` · ${t(T.doneLevel, { n: 2 ** level })}`
          : "");
  }

  // A line over the view, with its share done, 0..1.
  #showOver(text: string, share = -1): void {
    this.#over.hidden = !text;
    fill(
      this.#over,
      h("span", {}, text),
      share >= 0 && h("progress", { max: 1, value: share, "aria-label": text }),
    );
  }

  /** Deletes the mesh and what was made of it. */
  #remove(): void {
    this.#close();
    if (this.#assets.length > 0)
      this.#removing = this.#removeAll(this.#title.textContent ?? "").catch(this.onProblem);
  }

  async #removeAll(name: string): Promise<void> {
    const jobs = this.#jobs,
      assets = this.#assets;
    await this.#runner.stop();
    // Whether it is there and cannot be deleted; what is gone already is as wanted.
    const keeps = async (path: string): Promise<boolean> => {
      try {
        await this.api.request(path, { method: "DELETE" });
      } catch (error) {
        const status = error instanceof Problem ? error.status : 0;
        if (![404, 409, 410].includes(status)) throw error;
        return status === 409;
      }
      return false;
    };
    const remove = async (id: string): Promise<void> => {
      const path = `/v1/jobs/${id}/result`;
      if (!(await keeps(path))) return;
      // A job that is being cancelled may have frames yet.
      for await (const _ of this.api.events(id, AbortSignal.timeout(CANCEL_MS_MAX)));
      await keeps(path);
    };
    let failure: unknown = null; // what remains must not keep the rest
    const tried = (done: Promise<unknown>) => done.catch(error => (failure ??= error));
    for (const id of jobs) await tried(remove(id));
    for (const id of assets) await tried(keeps(`/v1/assets/${id}`));
    if (failure) throw failure;
    this.onNote(t(T.removed, { name }));
  }

  /** Back to the start. */
  #close(): void {
    this.#loading?.abort();
    this.#pricing?.abort();
    clearTimeout(this.#timer);
    void this.#runner.stop().catch(this.onProblem);
    this.#bundle = this.#asset = null;
    this.#clear();
    const hadFocus = this.#panel.contains(document.activeElement);
    this.#panel.hidden = true;
    this.#showOver("");
    byId("start").hidden = false;
    if (hadFocus) byId("files").focus();
    document.body.classList.remove("open");
  }

  /** Shows no voxels. */
  #clear(): void {
    this.#stage.clear();
    this.#timeline.show(0, 0, 1);
    this.#take.show(null);
    this.#facts.hidden = byId("pick").hidden = true;
    document.body.classList.remove("shown");
  }
}
