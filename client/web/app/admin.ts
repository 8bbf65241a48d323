// The view /admin: queue and devices live, failures, storage, limits. A tenant sees what is its
// own, an admin everything, and the keys.
import { isAbort, Problem, type Api } from "./api";
import { byId, field, fill, h } from "./dom";
import type { Asset, JobStatus, Key, Me, Queue, StoredResult } from "./model";
import { bytesText, count, linesOf, names, progressOf, t, T } from "./texts";

const REFRESH_MS = 1500;
const ROWS = 50;

type Row = readonly (Node | string)[];

function table(heads: readonly string[], rows: readonly Row[], empty: string): HTMLElement {
  if (rows.length === 0) return h("p", { className: "quiet" }, empty);
  return h(
    "div",
    { className: "scroll", tabIndex: 0 },
    h(
      "table",
      {},
      h("thead", {}, h("tr", {}, ...heads.map(head => h("th", { scope: "col" }, head)))),
      h("tbody", {}, ...rows.map(row => h("tr", {}, ...row.map(cell => h("td", {}, cell))))),
    ),
  );
}

/** Replaces the children, unless one of them is in use. */
function refill(element: Element, ...children: (Node | null)[]): void {
  if (element.contains(document.activeElement) || element.querySelector(":active")) return;
  fill(element, ...children);
}

function when(milliseconds: number): string {
  return new Date(milliseconds).toLocaleString();
}

function limitName(limit: string): string {
  return names[`limit_${limit}`]!;
}

function limitText(limit: string, value: number | null): string {
  return !value ? T.limitNone : limit === "bytes" ? bytesText(value) : count(value);
}

export class Admin {
  readonly #access = h("p", { className: "quiet" });
  readonly #devices = h("div");
  readonly #queue = h("div", { "aria-live": "off" });
  readonly #failures = h("div");
  readonly #use = h("p");
  readonly #disk = h("p");
  readonly #results = h("div");
  readonly #assets = h("div");
  readonly #limits = h("div");
  readonly #keys = h("div");
  readonly #keysCard: HTMLElement; // for admins
  #told = ""; // the last problem of the polling

  constructor(
    private readonly api: Api,
    private readonly onProblem: (error: unknown) => void,
    private readonly onNote: (text: string) => void,
  ) {
    const section = (title: T, ...children: HTMLElement[]) =>
      h("section", { className: "card" }, h("h2", { tabIndex: -1 }, title), ...children);
    this.#keysCard = section(T.keys, this.#keys, this.#keyForm());
    this.#keysCard.hidden = true;
    byId("admin").append(
      h("h1", {}, T.adminTitle),
      this.#access,
      section(T.devices, this.#devices),
      section(T.queue, this.#queue),
      section(T.failures, this.#failures),
      section(T.storage,
        this.#use,
        this.#disk,
        h("h3", {}, T.results),
        this.#results,
        h("h3", {}, T.assets),
        this.#assets,
      ),
      section(T.limits, this.#limits),
      this.#keysCard,
    );
  }

  /** Shows everything, and the queue as it changes. */
  async run(): Promise<void> {
    for (let hasStorage = false; ;) {
      if (!document.hidden) {
        try {
          await Promise.all([
            this.#showQueue(),
            hasStorage ||
              this.#showStorage().then(() => {
                hasStorage = true;
              }),
          ]);
          this.#told = "";
        } catch (error) {
          // A problem that stays is told once: it may have been dismissed.
          if (!isAbort(error) && this.#told !== String(error)) this.onProblem(error);
          this.#told = String(error);
        }
      }
      await new Promise(resolve => setTimeout(resolve, REFRESH_MS));
    }
  }

  #keyForm(): HTMLElement {
    const name = h("input", { required: true });
    const expires = h("input", { placeholder: "90d" });
    const rate = h("input", { placeholder: "10/s" });
    const bytes = h("input", { type: "number", min: 1 });
    const admin = h("input", { type: "checkbox" });
    const shown = h("div");
    const add = async () => {
      const { key } = await this.api.json<Key>("/v1/keys", {
        body: {
          name: name.value,
          admin: admin.checked,
          expires: expires.value || undefined,
          rate: rate.value || undefined,
          bytes: +bytes.value || undefined,
        },
        isOnce: true,
      });
      const secret = h("input", { readOnly: true, value: key });
      form.reset();
      fill(shown, field(T.keyNew, secret));
      secret.focus();
      secret.select();
      await this.#showKeys();
    };
    const form = h(
      "form",
      {
        className: "stack",
        onsubmit: (event: Event) => {
          event.preventDefault();
          void add().catch(this.onProblem);
        },
      },
      field(T.name, name),
      field(T.expires, expires),
      field(T.requests, rate),
      field(names["limit_bytes"]!, bytes),
      h(
        "p",
        { className: "row" },
        h("label", { className: "check" }, admin, T.admin),
        h("button", {}, T.add),
      ),
      shown,
    );
    return form;
  }

  async #showKeys(): Promise<void> {
    const { keys } = await this.api.json<{ keys: Key[] }>("/v1/keys?limit=1000");
    refill(
      this.#keys,
      table(
        [T.name, T.role, T.limits, T.expires, T.state, ""],
        keys.map(key => {
          const name = `${key.name} ${key.id}`;
          return [
            name,
            key.admin ? T.admin : T.tenant,
            Object.entries(key.limits)
              .filter(([, value]) => value)
              .map(([limit, value]) => limitName(limit) + ": " + limitText(limit, value))
              .join(", "),
            key.expires_ms ? when(key.expires_ms) : "",
            key.state,
            key.state === "live"
              ? this.#button(
                  T.revoke,
                  name,
                  () => this.api.request(`/v1/keys/${key.id}`, { method: "DELETE" }),
                  () => this.#showKeys(),
                )
              : "",
          ];
        }),
        "",
      ),
    );
  }

  async #showQueue(): Promise<void> {
    const [queue, failed] = await Promise.all([
      this.api.json<Queue>(`/v1/queue?limit=${ROWS}`),
      this.api.json<{ jobs: JobStatus[] }>("/v1/jobs?state=failed&limit=10"),
    ]);
    refill(
      this.#devices,
      table(
        [T.device, T.renderer, T.workers, T.memory],
        queue.devices.map(device => [
          device.device,
          device.renderer,
          `${device.workers_busy} / ${device.workers}`,
          device.memory_bytes ? bytesText(device.memory_bytes) : "",
        ]),
        T.nothing,
      ),
    );
    const { others, store } = queue;
    this.#disk.textContent = store
      ? t(T.disk, {
          bytes: bytesText(store.bytes),
          free: bytesText(store.disk_free_bytes),
          total: bytesText(store.disk_bytes),
        })
      : "";
    refill(
      this.#queue,
      table(
        [T.job, T.tenant, T.device, T.state, T.progress, ""],
        queue.jobs.map(job => [
          job.filename || job.id.slice(0, 10),
          job.tenant ?? "",
          job.device ?? "",
          job.state,
          progressOf(job),
          this.#button(
            T.cancel,
            job.filename || job.id,
            () => this.api.request(`/v1/jobs/${job.id}`, { method: "DELETE" }),
            () => this.#showQueue(),
          ),
        ]),
        T.queueNone,
      ),
      others.running + others.queued > 0
        ? h("p", { className: "quiet" }, t(T.queueOthers, others))
        : null,
    );
    refill(
      this.#failures,
      table(
        [T.job, T.when, T.failures],
        failed.jobs.map(job => [
          job.filename || job.id.slice(0, 10),
          when(job.ended_ms ?? job.created_ms),
          job.error ? [job.error.detail, ...linesOf(job.error)].join("; ") : "",
        ]),
        T.failuresNone,
      ),
    );
  }

  async #showStorage(): Promise<void> {
    const me = await this.api.json<Me>("/v1/me");
    this.#access.textContent = me.key === "" ? T.adminOpen : me.admin ? T.adminAll : T.adminTenant;
    this.#keysCard.hidden = !me.admin;
    if (me.admin) await this.#showKeys();
    const [used, limit] = [me.usage["bytes"] ?? 0, me.limits["bytes"] ?? null];
    this.#use.textContent =
      limit === null
        ? t(T.storageUse, { bytes: bytesText(used) })
        : t(T.storageOf, { bytes: bytesText(used), limit: bytesText(limit) });
    refill(
      this.#limits,
      table(
        [T.limits, ""],
        Object.entries(me.limits).map(([name, value]) => [limitName(name), limitText(name, value)]),
        T.limitNone,
      ),
    );
    const [results, assets] = await Promise.all([
      this.api.json<{ results: StoredResult[] }>(`/v1/results?limit=${ROWS}`),
      this.api.json<{ assets: Asset[] }>(`/v1/assets?limit=${ROWS}`),
    ]);
    refill(
      this.#results,
      table(
        [T.name, T.bytes, T.when, ""],
        results.results.map(result => [
          result.filename,
          bytesText(result.bytes),
          when(result.created_ms),
          this.#button(
            T.remove,
            result.filename,
            () => this.#remove(`/v1/jobs/${result.job}/result`, result.filename),
            () => this.#showStorage(),
          ),
        ]),
        T.nothing,
      ),
    );
    refill(
      this.#assets,
      table(
        [T.name, T.bytes, T.when, ""],
        assets.assets.map(asset => [
          asset.filename || asset.id.slice(0, 15),
          bytesText(asset.bytes),
          when(asset.created_ms),
          this.#button(
            T.remove,
            asset.filename || asset.id,
            () => this.#remove(`/v1/assets/${asset.id}`, asset.filename),
            () => this.#showStorage(),
          ),
        ]),
        T.nothing,
      ),
    );
  }

  // The action ends the button's row, so the focus goes to the heading of the section.
  #button(
    text: string,
    of: string,
    action: () => Promise<unknown>,
    refresh: () => Promise<void>,
  ): HTMLElement {
    const act = async () => {
      await action();
      button.closest("section")?.querySelector("h2")?.focus();
      await refresh();
    };
    const button = h(
      "button",
      { "aria-label": `${text}: ${of}`, onclick: () => void act().catch(this.onProblem) },
      text,
    );
    return button;
  }

  async #remove(path: string, name: string): Promise<void> {
    try {
      await this.api.request(path, { method: "DELETE" });
    } catch (error) {
      if (!(error instanceof Problem) || (error.status !== 410 && error.status !== 404))
        throw error;
    }
    this.onNote(t(T.removed, { name }));
  }
}
