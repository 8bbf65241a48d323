// The view /admin: queue and devices live, failures, storage, limits. A tenant sees what is its
// own, an admin everything, and the keys.
import { isAbort, Problem, type Api } from "./api";
import { byId, field, fill, h } from "./dom";
import type { Asset, JobStatus, Key, Me, Queue, StoredResult } from "./model";
import { bytesText, count, linesOf, names, progressOf, t, T } from "./texts";

const REFRESH_MS = 1500;
const ROWS = 50, // until more are wanted
  ROWS_MAX = 1000; // of one response

type Row = readonly [id: string, ...cells: (Node | string)[]];

/** A table of rows that come again and again. Those of before keep their buttons and the focus. */
class Table {
  limit = ROWS; // of the request for them
  readonly element = h("div", { className: "stack" });
  #rows = new Map<string, HTMLTableRowElement>();
  readonly #body = h("tbody");
  readonly #table: HTMLElement;
  readonly #empty: HTMLElement;
  readonly #more: HTMLButtonElement;

  constructor(heads: readonly string[], empty: string, refresh: () => void) {
    this.#table = h(
      "div",
      { className: "scroll", tabIndex: 0 },
      h(
        "table",
        {},
        h("thead", {}, h("tr", {}, ...heads.map(head => h("th", { scope: "col" }, head)))),
        this.#body,
      ),
    );
    this.#empty = h("p", { className: "quiet" }, empty);
    const onclick = () => {
      this.limit = ROWS_MAX;
      this.#table.focus({ preventScroll: true }); // the button may go
      refresh();
    };
    this.#more = h("button", { onclick }, T.showMore);
  }

  /** next: set where there are more rows. */
  show(rows: readonly Row[], next?: string): void {
    const { element } = this,
      body = this.#body,
      focused = document.activeElement as HTMLElement,
      hadFocus = element.contains(focused),
      cellsOf = new Map<string, (Node | string)[]>();
    for (let [id, ...cells] of rows) {
      while (cellsOf.has(id)) id += "#"; // the same mesh of several tenants
      cellsOf.set(id, cells);
    }
    for (const [id, row] of this.#rows) {
      if (cellsOf.has(id)) continue;
      row.remove();
      this.#rows.delete(id);
    }
    [...cellsOf].forEach(([id, cells], i) => {
      const row = this.#rows.get(id) ?? h("tr");
      this.#rows.set(id, row);
      cells.forEach((cell, k) => {
        const old = row.cells[k] ?? row.insertCell();
        if (old.textContent !== (typeof cell === "string" ? cell : cell.textContent)) fill(old, cell);
      });
      if (body.rows[i] !== row) body.insertBefore(row, body.rows[i] ?? null);
    });
    const shown = rows.length > 0 ? this.#table : this.#empty;
    if (element.firstChild !== shown) fill(element, shown, this.#more);
    this.#more.hidden = !next || rows.length > ROWS; // these are all of one response
    if (hadFocus)
      (focused.isConnected && !focused.hidden
        ? focused
        : element.closest("section")!.querySelector("h2")!
      ).focus({ preventScroll: true });
  }
}

function when(milliseconds: number): string {
  return new Date(milliseconds).toLocaleString();
}

function nameOf({ filename, id }: Asset | JobStatus): string {
  return filename || id.slice(0, 15);
}

function limitName(limit: string): string {
  return names[`limit_${limit}`]!;
}

function limitText(limit: string, value: number | null): string {
  return !value ? T.limitNone : limit === "bytes" ? bytesText(value) : count(value);
}

export class Admin {
  readonly #access = h("p", { className: "quiet" });
  readonly #devices = this.#table([T.device, T.renderer, T.workers, T.memory]);
  readonly #queue = this.#table(
    [T.job, T.tenant, T.device, T.state, T.progress, ""],
    T.queueNone,
    () => this.#showQueue(),
  );
  readonly #others = h("p", { className: "quiet" });
  readonly #failures = this.#table([T.job, T.when, T.failures], T.failuresNone);
  readonly #use = h("p");
  readonly #disk = h("p");
  readonly #results = this.#table([T.name, T.bytes, T.when, ""]);
  readonly #assets = this.#table([T.name, T.bytes, T.when, ""]);
  readonly #limits = this.#table([T.limits, ""], T.limitNone);
  readonly #keys = this.#table([T.name, T.role, T.limits, T.expires, T.state, ""], "");
  readonly #keysCard: HTMLElement; // for admins
  #told = ""; // the last problem of the polling

  constructor(
    private readonly api: Api,
    private readonly onProblem: (error: unknown) => void,
    private readonly onNote: (text: string) => void,
  ) {
    const section = (title: T, ...children: HTMLElement[]) =>
      h("section", { className: "card" }, h("h2", { tabIndex: -1 }, title), ...children);
    this.#keysCard = section(T.keys, this.#keys.element, this.#keyForm());
    this.#keysCard.hidden = true;
    byId("admin").append(
      h("h1", {}, T.adminTitle),
      this.#access,
      section(T.devices, this.#devices.element),
      section(T.queue, this.#queue.element, this.#others),
      section(T.failures, this.#failures.element),
      section(T.storage,
        this.#use,
        this.#disk,
        h("h3", {}, T.results),
        this.#results.element,
        h("h3", {}, T.assets),
        this.#assets.element,
      ),
      section(T.limits, this.#limits.element),
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

  #table(
    heads: readonly string[],
    empty: string = T.nothing,
    refresh = () => this.#showStorage(),
  ): Table {
    return new Table(heads, empty, () => void refresh().catch(this.onProblem));
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
    const { keys } = await this.api.json<{ keys: Key[] }>(`/v1/keys?limit=${ROWS_MAX}`);
    this.#keys.show(
      keys.map(key => {
        const name = `${key.name} ${key.id}`;
        return [
          key.id,
          name,
          key.admin ? T.admin : T.tenant,
          Object.entries(key.limits)
            .filter(([, value]) => value)
            .map(([limit, value]) => limitName(limit) + ": " + limitText(limit, value))
            .join(", "),
          key.expires_ms ? when(key.expires_ms) : "",
          key.state,
          key.state === "live"
            ? this.#button(T.revoke, name, `/v1/keys/${key.id}`)
            : "",
        ];
      }),
    );
  }

  async #showQueue(): Promise<void> {
    const [queue, failed] = await Promise.all([
      this.api.json<Queue>(`/v1/queue?limit=${this.#queue.limit}`),
      this.api.json<{ jobs: JobStatus[] }>("/v1/jobs?state=failed&limit=10"),
    ]);
    this.#devices.show(
      queue.devices.map(device => [
        device.device,
        device.device,
        device.renderer,
        `${device.workers_busy} / ${device.workers}`,
        device.memory_bytes ? bytesText(device.memory_bytes) : "",
      ]),
    );
    const { others, store } = queue;
    this.#disk.textContent = store
      ? t(T.disk, {
          bytes: bytesText(store.bytes),
          free: bytesText(store.disk_free_bytes),
          total: bytesText(store.disk_bytes),
        })
      : "";
    this.#queue.show(
      queue.jobs.map(job => [
        job.id,
        nameOf(job),
        job.tenant ?? "",
        job.device ?? "",
        job.state,
        progressOf(job),
        this.#button(T.cancel, nameOf(job), `/v1/jobs/${job.id}`, () => this.#showQueue()),
      ]),
      queue.next,
    );
    this.#others.hidden = others.running + others.queued === 0;
    this.#others.textContent = t(T.queueOthers, others);
    this.#failures.show(
      failed.jobs.map(job => [
        job.id,
        nameOf(job),
        when(job.ended_ms ?? job.created_ms),
        job.error ? [job.error.detail, ...linesOf(job.error)].join("; ") : "",
      ]),
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
    this.#limits.show(
      Object.entries(me.limits).map(([name, value]) => [
        name,
        limitName(name),
        limitText(name, value),
      ]),
    );
    const [results, assets] = await Promise.all([
      this.api.json<{ results: StoredResult[]; next?: string }>(
        `/v1/results?limit=${this.#results.limit}`,
      ),
      this.api.json<{ assets: Asset[]; next?: string }>(`/v1/assets?limit=${this.#assets.limit}`),
    ]);
    const stored = (path: string, name: string, of: Asset | StoredResult): Row => [
      path + name,
      name,
      bytesText(of.bytes),
      when(of.created_ms),
      this.#button(T.remove, name, path),
    ];
    this.#results.show(
      results.results.map(result =>
        stored(`/v1/jobs/${result.job}/result`, result.filename, result),
      ),
      results.next,
    );
    this.#assets.show(
      assets.assets.map(asset =>
        stored(`/v1/assets/${asset.id}`, nameOf(asset), asset),
      ),
      assets.next,
    );
  }

  // Deletes what is at the path, or is gone from there.
  #button(
    text: T,
    name: string,
    path: string,
    refresh = () => this.#showStorage(),
  ): HTMLElement {
    const act = async () => {
      try {
        await this.api.request(path, { method: "DELETE" });
      } catch (error) {
        if (!(error instanceof Problem && [404, 410].includes(error.status))) throw error;
      }
      if (text === T.remove) this.onNote(t(T.removed, { name }));
      await refresh();
    };
    return h(
      "button",
      { "aria-label": `${text}: ${name}`, onclick: () => void act().catch(this.onProblem) },
      text,
    );
  }
}
