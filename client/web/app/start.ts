// The start: where files are dropped or chosen, where they go, and samples to click.
import { byId, fill, h } from "./dom";
import type { NamedFile } from "./files";
import { paintVoxels, type Cells } from "./icon";
import { samples } from "./samples";
import { names, t, T } from "./texts";

const HERO_CELLS = [5, 8, 12, 18, 30]; // of one picture after the other
const HERO_MS = 520;
const SAMPLE_CELLS = 12; // as samples.ts draws them

// The cells of a picture in another resolution.
function scaled(cells: Cells, n: number): Cells {
  const place = (x: number) => ((x + 0.5) * SAMPLE_CELLS) / n - 0.5;
  return (x, y, z) =>
    x < 0 || y < 0 || z < 0 || x >= n || y >= n || z >= n
      ? null
      : cells(place(x), place(y), place(z));
}

function paintHero(): void {
  const hero = byId<HTMLCanvasElement>("hero"),
    rocket = samples[0]?.icon as Cells;
  const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const paint = (step: number) => {
    const n = HERO_CELLS[step];
    if (n === undefined) return;
    paintVoxels(hero, n, scaled(rocket, n));
    setTimeout(() => paint(step + 1), HERO_MS);
  };
  paint(isCalm ? HERO_CELLS.length - 1 : 0);
}

function whereText(): string {
  const isLoopback = /^(localhost|127(\.\d+){3}|\[::1\])$/.test(location.hostname);
  if (isLoopback) return T.goesHere;
  return (
    t(T.goesTo, { host: location.host }) +
    (location.protocol === "https:" ? "" : ` ${T.goesPlain}`)
  );
}

/** Fills the start; `onFiles` gets the files of a sample. */
export function showStart(
  onFiles: (files: readonly NamedFile[]) => void,
  onProblem: (error: unknown) => void,
): void {
  const start = byId("start");
  (start.querySelector("h1") as HTMLElement).textContent = T.dropTitle;
  byId("hint").textContent = T.dropHint;
  byId("where").textContent = whereText();
  const files = h("input", { type: "file", id: "files", multiple: true, className: "away" });
  const folder = h("input", { type: "file", id: "folder", multiple: true, className: "away" });
  folder.webkitdirectory = true;
  fill(
    byId("choose"),
    h("label", { htmlFor: "files", className: "button primary" }, T.choose, files),
    h("label", { htmlFor: "folder", className: "button" }, T.chooseFolder, folder),
  );
  const list = h("div", { className: "cards" });
  for (const sample of samples) {
    const canvas = h("canvas", { width: 120, height: 120, "aria-hidden": "true" });
    paintVoxels(canvas, SAMPLE_CELLS, scaled(sample.icon, SAMPLE_CELLS));
    list.append(
      h(
        "button",
        { className: "sample", onclick: () => void sample.make().then(onFiles, onProblem) },
        canvas,
        h("span", {}, names[sample.name]),
        h("small", {}, sample.hint),
      ),
    );
  }
  fill(byId("samples"), h("h2", {}, T.samples), list);
  paintHero();
}
