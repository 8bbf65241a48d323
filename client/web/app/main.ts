// The page: which view it shows, and what all views share: the key, problems, notes.
import { Admin } from "./admin";
import { Api, Problem } from "./api";
import { App } from "./app";
import { byId, fill, h } from "./dom";
import { paintVoxels } from "./icon";
import { Keys } from "./keys";
import type { Me } from "./model";
import { t } from "./texts";

const NOTE_MS = 6000;

const banner = byId("banner"),
  status = byId("status");
let noteTimer = 0;

/** Tells something that needs no answer. */
function note(text: string): void {
  status.textContent = text;
  window.clearTimeout(noteTimer);
  noteTimer = window.setTimeout(() => {
    status.textContent = "";
  }, NOTE_MS);
}

/** Shows an error with what was expected and what came, until it is dismissed. */
function showProblem(error: unknown): void {
  const lines =
    error instanceof Problem
      ? [
          error.expected && t("expected", { text: error.expected }),
          error.got && t("got", { text: error.got }),
        ]
      : [];
  const title = error instanceof Error ? error.message : String(error);
  fill(
    banner,
    h(
      "div",
      {},
      h("strong", {}, title),
      ...lines.map(line => line && h("span", {}, line)),
      error instanceof Problem && h("code", {}, error.code),
    ),
    h(
      "button",
      {
        onclick: () => {
          banner.hidden = true;
        },
      },
      t("dismiss"),
    ),
  );
  banner.className = "problem";
  banner.hidden = false;
}

function showConnection(isOnline: boolean): void {
  if (isOnline) note(t("online"));
  fill(banner, h("div", {}, t("offline")));
  banner.className = "offline";
  banner.hidden = isOnline;
}

async function showTenant(api: Api, keys: Keys): Promise<void> {
  const me = await api.json<Me>("/v1/me");
  const button = byId<HTMLButtonElement>("keys");
  button.hidden = me.key === "";
  button.textContent = t("keyOf", { tenant: me.tenant });
  button.title = t("keyForget");
  button.onclick = () => keys.forget();
}

function start(): void {
  const keys = new Keys(),
    api = new Api();
  api.key = keys.stored();
  api.onKeyNeeded = refused => keys.ask(refused);
  api.onConnection = showConnection;
  api.onBusy = seconds => note(t("busy", { n: seconds }));
  keys.onForget = () => location.reload();
  const isAdmin = location.pathname === "/admin";
  document.title = isAdmin
    ? `${t("adminTitle")} · ${t("title")}`
    : `${t("title")} · ${t("tagline")}`;
  byId("tagline").textContent = t("tagline");
  const nav = byId<HTMLAnchorElement>("nav");
  nav.href = isAdmin ? "/" : "/admin";
  nav.textContent = t(isAdmin ? "home" : "activity");
  byId("logo").setAttribute("aria-label", t("title"));
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
