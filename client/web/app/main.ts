// The page: which view it shows, and what all views share: the key, problems, notes.
import { Admin } from "./admin";
import { Api, Problem } from "./api";
import { App } from "./app";
import { byId, fill, h } from "./dom";
import { paintVoxels } from "./icon";
import { Keys } from "./keys";
import type { ErrorBody, Me } from "./model";
import { linesOf, t, T } from "./texts";

const NOTE_MS = 6000;

const banner = byId("banner"),
  offline = byId("offline"),
  status = byId("status");
let noteTimer = 0;

/** Tells something that needs no answer. */
function note(text: string): void {
  status.textContent = text;
  clearTimeout(noteTimer);
  noteTimer = setTimeout(() => {
    status.textContent = "";
  }, NOTE_MS);
}

/** Shows an error with what was expected and what came, until it is dismissed. */
function showProblem(error: unknown): void {
  const title = error instanceof Error ? error.message : String(error);
  fill(
    banner,
    h(
      "div",
      {},
      h("strong", {}, title),
      ...linesOf(error as Partial<ErrorBody>).map(line => h("span", {}, line)),
      error instanceof Problem && h("code", {}, error.code),
    ),
    h(
      "button",
      {
        onclick: () => {
          banner.hidden = true;
        },
      },
      T.dismiss,
    ),
  );
  banner.hidden = false;
}

function showConnection(isOnline: boolean): void {
  if (isOnline) note(T.online);
  offline.textContent = T.offline;
  offline.hidden = isOnline;
}

async function showTenant(api: Api, keys: Keys): Promise<void> {
  const me = await api.json<Me>("/v1/me");
  const button = byId<HTMLButtonElement>("keys");
  button.hidden = me.key === "";
  button.textContent = t(T.keyOf, { tenant: me.tenant });
  button.title = T.keyForget;
  button.onclick = () => keys.forget();
}

function start(): void {
  const keys = new Keys(),
    api = new Api();
  api.key = keys.stored();
  api.onKeyNeeded = async refused => {
    api.key = await keys.ask(refused);
    void showTenant(api, keys).catch(showProblem);
    return api.key;
  };
  api.onConnection = showConnection;
  api.onBusy = seconds => note(t(T.busy, { n: seconds }));
  keys.onForget = () => location.reload();
  const isAdmin = location.pathname === "/admin";
  document.title = isAdmin
    ? `${T.adminTitle} · ${T.title}`
    : `${T.title} · ${T.tagline}`;
  byId("tagline").textContent = T.tagline;
  const nav = byId<HTMLAnchorElement>("nav");
  nav.href = isAdmin ? "/" : "/admin";
  nav.textContent = (isAdmin ? T.home : T.activity);
  byId("logo").setAttribute("aria-label", T.title);
  paintVoxels(byId<HTMLCanvasElement>("mark"), 2, (x, y, z) =>
    Math.max(x, y, z) > 1
      ? null
      : x + y + z === 3
        ? [255, 146, 84]
        : (x + y + z) % 2
          ? [122, 140, 246]
          : [84, 100, 222],
  );
  byId(isAdmin ? "admin" : "page").hidden = false;
  void showTenant(api, keys).catch(showProblem);
  if (isAdmin) void new Admin(api, showProblem, note).run();
  else new App(api, showProblem, note);
}

start();
