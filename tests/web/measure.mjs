// Times of the page in Debian's Chromium: node measure.mjs FILE:SIZE... prints a row for each mesh, after
// a row of column names. Milliseconds are from the files' choice on.
import { basename } from "node:path";
import { chromium } from "@playwright/test";
import { Daemon } from "./daemon.mjs";
import config from "./playwright.config.mjs";

const QUIET_MS = 1500; // without a draw: the view is at rest
const DRAG_MS = 3000;

const cases = process.argv.slice(2).map(text => {
  const [, file, size] = /^(.+):(\d+)$/.exec(text) ?? [];
  if (!file) throw new Error("usage: node measure.mjs FILE:SIZE...");
  return { file, size: Number(size) };
});

/** In the page: when frames began and were finished, and when grids were there. */
function watch() {
  window.drawn = []; // [begin, end] of frames and strips
  window.facts_at = []; // [time, text]
  const gl = WebGL2RenderingContext.prototype;
  let begin = 0;
  const draw = gl.drawArrays,
    wait = gl.clientWaitSync;
  gl.drawArrays = function (...given) {
    begin ||= performance.now();
    return draw.apply(this, given);
  };
  gl.clientWaitSync = function (...given) {
    const state = wait.apply(this, given);
    if (begin && state !== gl.TIMEOUT_EXPIRED) {
      window.drawn.push([begin, performance.now()]);
      begin = 0;
    }
    return state;
  };
  new MutationObserver(() => {
    const facts = document.getElementById("facts");
    if (facts && !facts.hidden) window.facts_at.push([performance.now(), facts.textContent]);
  }).observe(document, { subtree: true, childList: true, characterData: true, attributes: true });
}

const now = page => page.evaluate(() => performance.now());
const ends = page => page.evaluate(() => window.drawn.map(([, end]) => end));

/** Waits until a frame was drawn after `since`, and then none for a while; when the last one was finished. */
async function rest(page, since = 0) {
  for (;;) {
    const last = (await ends(page)).at(-1) ?? 0;
    if ((await now(page)) - last > QUIET_MS && last > since) return last;
    await page.waitForTimeout(200);
  }
}

/** Drags the view for DRAG_MS; the median of its frames. */
async function moving(page) {
  const { x, y, width, height } = await page.locator("#canvas").boundingBox();
  const first = (await ends(page)).length;
  await page.mouse.move(x + width / 2, y + height / 2);
  await page.mouse.down();
  for (let i = 1; i <= DRAG_MS / 20; ++i) {
    await page.mouse.move(x + width / 2 + 2 * i, y + height / 2);
    await page.waitForTimeout(20);
  }
  await page.mouse.up();
  const frames = await page.evaluate(
    at => window.drawn.slice(at).map(([begin, end]) => end - begin),
    first,
  );
  return frames.sort((a, b) => a - b)[frames.length >> 1];
}

async function measure(browser, { file, size }) {
  const daemon = await new Daemon().start();
  const page = await browser.newPage({ viewport: { width: 1120, height: 640 } });
  const network = await page.context().newCDPSession(page);
  let bytes = 0;
  network.on("Network.loadingFinished", event => (bytes += event.encodedDataLength));
  await network.send("Network.enable");
  await page.addInitScript(watch);
  await page.goto(daemon.url);
  await page.evaluate(side => {
    const input = document.getElementById("size");
    input.value = String(side);
    input.dispatchEvent(new Event("change"));
  }, size);
  bytes = 0;
  const start = await now(page);
  await page.setInputFiles("#files", file);
  const run = page.locator("#run");
  const full = new RegExp(`voxels, .*\\b${size}\\b(?!.*Preview)`);
  const isFull = () =>
    page.evaluate(
      pattern => (window.facts_at.find(([, text]) => new RegExp(pattern).test(text)) ?? [0])[0],
      full.source,
    );
  await page.waitForFunction(() => document.getElementById("price")?.textContent);
  await page.waitForTimeout(400);
  if (!(await isFull()) && (await page.locator("#cancel").isHidden())) await run.click();
  let at = 0;
  while (!(at = await isFull())) await page.waitForTimeout(50);
  const still = await rest(page, at);
  const all = await ends(page);
  const row = {
    first: all.find(end => end > start) - start,
    full: all.find(end => end > at) - start,
    rest: still - start,
    moving: await moving(page),
  };
  await rest(page);
  await network.send("HeapProfiler.collectGarbage");
  const { usedSize } = await network.send("Runtime.getHeapUsage");
  await page.context().close();
  await daemon.end();
  const text = Object.values(row).map(ms => Math.round(ms));
  return [basename(file), size, ...text, Math.round(bytes / 1000), (usedSize / 1e6).toFixed(1)];
}

console.log("| mesh | size | first | full | at rest | frame while moving | KB | heap MB |");
console.log("|---|---|---|---|---|---|---|---|");
for (const one of cases) {
  const browser = await chromium.launch(config.use.launchOptions);
  try {
    console.log(`| ${(await measure(browser, one)).join(" | ")} |`);
  } finally {
    await browser.close();
  }
}
