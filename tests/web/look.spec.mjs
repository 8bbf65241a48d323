// The view: voxels under the pointer, camera, section, parts, animations, grids that come late.
import { readFileSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import { temporaryFolder } from "./daemon.mjs";
import {
  daemon,
  DRAWN,
  drop,
  expect,
  fixtures,
  hasPicture,
  LONG,
  resize,
  settled,
  shown,
  test,
} from "./page.mjs";

/** The numbers of the cell that a text tells. */
function cellOf(text) {
  return text.match(/-?\d+/g).slice(0, 3).map(Number);
}

test("a double click marks a voxel, and others tell how far they are from it", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  const canvas = page.locator("#canvas");
  const box = await canvas.boundingBox();
  const middle = { x: box.width / 2, y: box.height / 2 };
  await canvas.hover({ position: middle });
  await expect(page.locator("#pick")).toContainText(/cell/i);
  await expect(page.locator("#pick")).not.toContainText("from the mark");
  await canvas.dblclick({ position: middle });
  await expect(page.locator("#pick")).toContainText("0, 0, 0 cells from the mark: 0");
  const from = cellOf(await page.locator("#pick").textContent());
  await canvas.hover({ position: { x: middle.x + box.height / 20, y: middle.y + box.height / 20 } });
  await expect(page.locator("#pick")).not.toContainText("0, 0, 0 cells from the mark");
  const text = await page.locator("#pick").textContent();
  const to = cellOf(text);
  expect(text).toContain(`${to.map((c, k) => c - from[k]).join(", ")} cells from the mark: `);
  await canvas.dblclick({ position: { x: box.width / 12, y: box.height / 12 } });
  await canvas.hover({ position: middle });
  await expect(page.locator("#pick")).not.toContainText("from the mark");
});

test("the voxel under the pointer goes with its grid", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.locator("#canvas").hover(); // its middle
  await expect(page.locator("#pick")).toContainText(/cell/i);
  await resize(page, 64);
  await shown(page, 64);
  await expect(page.locator("#pick")).toBeHidden();
});

test("a close camera sees the voxels of a large grid", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  const asked = []; // sizes
  page.on("request", request => {
    if (request.url().endsWith("/v1/jobs")) asked.push(request.postDataJSON()?.options?.size);
  });
  await resize(page, 1200);
  await page.click("#run");
  await shown(page, 1200);
  expect(asked.slice(-3)).toEqual([128, 1024, 1200]);
  await expect(page.locator("#facts")).toContainText("shown at 1:2");
  const regions = [];
  page.on("request", request => regions.push(new URL(request.url()).searchParams.get("region")));
  const canvas = page.locator("#canvas");
  const box = await canvas.boundingBox();
  // Cells under a row of points: those that are shown, and those of the finest level among them.
  const cells = async () => {
    const found = { all: 0, odd: 0 };
    for (let i = -6; i <= 6; ++i) {
      await page.mouse.move(box.x + box.width / 2 + 16 * i, box.y + box.height / 2 + i);
      const text = await page.evaluate(() => {
        const pick = document.getElementById("pick");
        return pick.hidden ? null : pick.textContent;
      });
      if (text === null) continue;
      ++found.all;
      const cell = cellOf(text);
      if (cell.some(c => c % 2 !== 0)) ++found.odd;
    }
    return found;
  };
  const before = await cells();
  expect(before.odd).toBe(0);
  expect(before.all).toBeGreaterThan(3);
  for (let i = 0; i < 4; ++i) await page.mouse.wheel(0, -300);
  await expect.poll(async () => (await cells()).odd).toBeGreaterThan(1);
  expect(regions.filter(region => region !== null).length).toBeGreaterThan(0);
  await page.click("#reset");
  await expect.poll(async () => (await cells()).odd).toBe(0);
});

test("a box leaves the cells between its ends", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  const canvas = page.locator("#canvas"),
    pick = page.locator("#pick"),
    end = name => page.getByLabel(`Box along ${name}`);
  const box = await canvas.boundingBox();
  const picked = async () => {
    await canvas.hover({ position: { x: box.width / 12, y: box.height / 12 } });
    await canvas.hover({ position: { x: box.width / 2, y: box.height / 2 } });
    return (await pick.isHidden()) ? null : cellOf(await pick.textContent());
  };
  const [, y] = await picked();
  await page.check('#card-look input[value="box"]', { force: true });
  expect((await picked())[1]).toBe(y);
  await end("y from").fill(String(y + 1));
  expect((await picked())?.[1] ?? y + 1).toBeGreaterThan(y);
  await expect(page.locator("#card-look output").nth(2)).toHaveText(
    new RegExp(`^${y + 1}–(\\d+) / \\1$`),
  );
  // Ends that have passed each other, and another grid, for which they stay where they are.
  await end("y to").fill("0");
  await expect(page.locator("#card-look output").nth(2)).toHaveText(new RegExp(`^0–${y + 1} / `));
  expect((await picked())?.[1] ?? 0).toBeLessThanOrEqual(y);
  await resize(page, 128);
  await shown(page, 128);
  const half = Math.round((y + 1) / 2);
  await expect(page.locator("#card-look output").nth(2)).toHaveText(
    new RegExp(`^0–(${half - 1}|${half}) / `),
  );
  await page.check('#card-look input[value=""]', { force: true });
  await expect(end("y to")).toBeHidden();
  expect(await picked()).not.toBeNull();
});

test("a grid without voxels has none, and is no animation", async ({ page }) => {
  await page.route("**/v1/jobs/*", async route => {
    const response = await route.fetch(),
      job = await response.json();
    if (job.result?.meta) job.result.meta.voxel_count = 0;
    await route.fulfill({ response, json: job });
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#facts")).toHaveText(/^0 voxels, /);
});

test("a grid that comes after its mesh was left tells nothing", LONG, async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    await held;
    await route.continue();
  });
  await page.goto(daemon.url);
  const asked = page.waitForRequest("**/v1/grids/*");
  await drop(page, join(fixtures, "sample.ply"));
  await asked;
  await page.click("#new");
  const came = page.waitForResponse("**/v1/grids/*");
  release();
  const url = (await came).url();
  // The same bytes once more: the page has read its own by then.
  await page.evaluate(async url => (await (await fetch(url)).blob()).arrayBuffer(), url);
  await expect(page.locator("#start")).toBeVisible();
  await expect(page.locator("#facts")).toBeHidden();
});

test("a grid that comes after the next one tells nothing", LONG, async ({ page }) => {
  let isFirst = true,
    release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    if (isFirst) {
      isFirst = false;
      await held;
    }
    await route.continue();
  });
  await page.goto(daemon.url);
  const asked = page.waitForRequest("**/v1/grids/*");
  await drop(page, join(fixtures, "sample.ply"));
  const url = (await asked).url();
  await resize(page, 64);
  await shown(page, 64);
  const came = page.waitForResponse(url);
  release();
  await came;
  // The same bytes once more: the page has read its own by then.
  await page.evaluate(async url => (await (await fetch(url)).blob()).arrayBuffer(), url);
  await shown(page, 64);
});

test("an animation has a timeline that plays", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await expect(page.locator("#timeline")).toBeVisible();
  await expect(page.locator("#card-model")).toContainText("1 animation");
  await shown(page, 128);
  const frame = page.locator("#timeline output");
  await expect(frame).toHaveText(/^1 \/ \d\d/);
  await expect(page.locator("#commands pre")).toContainText("size=128"); // all frames are there
  await expect(frame).toHaveAttribute("aria-live", "off");
  await page.click("#timeline button");
  await expect(frame).not.toHaveText(/^1 \//);
  await page.click("#timeline button");
  await page.locator("#timeline input").fill("3");
  await expect(frame).toHaveText(/^4 \//);
});

test("each animation has the frames of its own rate", async ({ page }) => {
  const folder = temporaryFolder("web-worm"),
    walk = join(fixtures, "worm/walk.md5anim"),
    slow = join(folder, "slow.md5anim");
  const rate = Number(/frameRate (\d+)/.exec(readFileSync(walk, "utf8"))[1]);
  writeFileSync(slow, readFileSync(walk, "utf8").replace(/frameRate \d+/, "frameRate 3"));
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "worm/worm.md5mesh"), walk, slow);
  const settings = page.locator("#card-voxels"),
    animation = settings.getByLabel("Animation");
  for (const [name, fps] of [["slow", 3], ["walk", rate]]) {
    const option = animation.locator("option", { hasText: name });
    await animation.selectOption(await option.getAttribute("value"));
    await expect(settings.getByLabel("Frames per second")).toHaveValue(String(fps));
  }
});

test("a frame that does not come is a problem, and the animation plays on", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  await page.route("**/frames/6*", route =>
    route.fulfill({ status: 400, json: { code: "test", detail: "frame 6 is lost" } }),
  );
  const frame = page.locator("#timeline output"),
    play = page.locator("#timeline button");
  await page.locator("#timeline input").fill("6");
  await expect(page.locator("#banner")).toContainText("frame 6 is lost");
  await expect(play).toHaveText("Play");
  await page.unroute("**/frames/6*");
  await play.click();
  await expect(play).toHaveText("Pause");
  await expect(frame).not.toHaveText(/^7 \//);
});

test("a frame that does not come is no problem once its mesh was left", LONG, async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const path = "**/frames/6*";
  await page.route(path, async route => {
    await held;
    await route.fulfill({ status: 400, json: { code: "test", detail: "frame 6 is lost" } });
  });
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  const asked = page.waitForRequest(path);
  await page.locator("#timeline input").fill("6");
  await asked;
  await page.click("#new");
  const came = page.waitForResponse(path);
  release();
  await came;
  // Another response: the page has read that one by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  await expect(page.locator("#banner")).toBeHidden();
});

test("an animation that plays ends with its mesh, and the next one begins anew", LONG, async ({ page }) => {
  const frame = page.locator("#timeline output");
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await shown(page, 16);
  await page.click("#timeline button");
  await expect(frame).not.toHaveText(/^1 \//);
  await page.click("#new");
  await page.click('.sample:has-text("Worm")');
  await shown(page, 16);
  await expect(frame).toHaveText(/^1 \/ \d\d/);
  await expect(page.locator("#timeline button")).toHaveText("Play");
  await expect(page.locator("#banner")).toBeHidden();
});

test("of two plays with a pause between them the later one goes on", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Worm")');
  await resize(page, 16);
  await expect(page.locator("#commands pre")).toContainText("size=16"); // all frames are there
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/frames/*", async route => {
    await held;
    await route.continue();
  });
  const play = page.locator("#timeline button");
  const asked = page.waitForRequest("**/frames/*");
  await play.click();
  await asked; // the loop waits for a frame
  await page.waitForTimeout(400); // by so much a second loop would be elsewhere
  await play.click();
  await play.click();
  const came = page.waitForResponse("**/frames/*");
  release();
  await came;
  const { back, elapsed, frames } = await page.evaluate(async () => {
    const [input, output] = ["input", "output"].map(name =>
      document.querySelector(`#timeline ${name}`),
    );
    const begin = performance.now();
    let back = 0;
    for (let i = 0, last = 0; i < 90; ++i) {
      await new Promise(requestAnimationFrame);
      const frame = parseInt(output.textContent);
      if (frame < last) ++back;
      last = frame;
    }
    return { back, elapsed: performance.now() - begin, frames: Number(input.max) + 1 };
  });
  // Back from the end to the beginning, at 24 frames a second.
  expect(back).toBeLessThanOrEqual(2 + (elapsed * 24) / 1000 / frames);
});

/** The share of the view that differs from a screenshot, by areas: the fineness of a frame is none. */
async function differing(page, before) {
  const now = await page.locator("#view").screenshot();
  return await page.evaluate(
    async texts => {
      const [a, b] = await Promise.all(
        texts.map(async text => {
          const image = await createImageBitmap(
            new Blob([Uint8Array.from(atob(text), c => c.charCodeAt(0))]),
            { resizeWidth: 64, resizeHeight: 64, resizeQuality: "high" },
          );
          const context = new OffscreenCanvas(64, 64).getContext("2d");
          context.drawImage(image, 0, 0);
          return context.getImageData(0, 0, 64, 64).data;
        }),
      );
      return a.filter((value, i) => Math.abs(value - b[i]) > 40).length / a.length;
    },
    [before, now].map(shot => shot.toString("base64")),
  );
}

/** The camera, as the page asks the daemon for a turntable of the view. */
async function cameraOf(page) {
  let options;
  const path = "**/v1/jobs";
  await page.route(path, async route => {
    ({ options } = route.request().postDataJSON());
    await route.fulfill({ status: 400, json: { code: "test", detail: "not drawn" } });
  });
  await page.click('button:text-is("Turntable GIF")');
  await page.click("#banner button");
  await page.unroute(path);
  await page.evaluate(() => (document.getElementById("status").textContent = ""));
  const { azimuth, elevation, zoom } = options;
  return { azimuth, elevation, zoom };
}

test("the view turns by keys, is cut by a section and keeps its camera", DRAWN, async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Knot")');
  await resize(page, 96);
  await shown(page, 96);
  await page.click("#pictures summary");
  const view = page.locator("#view");
  await expect.poll(() => hasPicture(page)).toBe(true);
  expect(await cameraOf(page)).toMatchObject({ azimuth: "30.0", elevation: "20.0" });
  const start = await view.screenshot();
  await page.focus("#canvas");
  for (let i = 0; i < 4; ++i) await page.keyboard.press("ArrowRight");
  await expect.poll(() => differing(page, start)).toBeGreaterThan(0.05);
  const camera = await cameraOf(page);
  await settled(page);
  expect(camera).toMatchObject({ azimuth: "50.0", elevation: "20.0" });
  const whole = await view.screenshot();
  await page.check('#card-look input[value="y"]', { force: true });
  await expect(page.locator("#card-look output[for=cut]")).toHaveText(/^\d+ \/ \d+$/);
  await expect.poll(() => differing(page, whole)).toBeGreaterThan(0.05);
  await page.check('#card-look input[value=""]', { force: true });
  await expect.poll(() => differing(page, whole)).toBeLessThan(0.02);
  await page.check('#card-look input[value="y"]', { force: true });
  await page.selectOption("#card-look select", "clay");
  await resize(page, 64);
  await shown(page, 64);
  await expect(page.locator("#card-look output[for=cut]")).toHaveText(/^\d+ \/ \d+$/);
  await expect.poll(() => differing(page, whole)).toBeGreaterThan(0.05);
  expect(await cameraOf(page)).toEqual(camera);
});

test("without WebGL 2 the daemon draws", async ({ page }) => {
  await page.addInitScript(() => {
    const original = HTMLCanvasElement.prototype.getContext;
    HTMLCanvasElement.prototype.getContext = function (kind, ...rest) {
      return kind === "webgl2" ? null : original.call(this, kind, ...rest);
    };
  });
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Rocket")');
  await shown(page, 256);
  await expect(page.locator("#picture")).toHaveAttribute("src", /^blob:/);
  await expect(page.locator("#card-look")).toContainText("no WebGL 2");
  await expect.poll(() => hasPicture(page)).toBe(true);
});

test("the daemon draws once the context is lost for good", async ({ page }) => {
  // A wait for the browser to give the context back ends at once.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => original(call, ms === 10_000 ? 0 : ms, ...given);
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-look").getByLabel("Show", { exact: true })).toBeVisible();
  expect(page.workers()).toHaveLength(1);
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  await page.route("**/v1/grids/*", async route => {
    await held;
    await route.continue();
  });
  const asked = page.waitForRequest("**/v1/grids/*");
  await resize(page, 64);
  const url = (await asked).url();
  await page.focus("#canvas");
  await page.evaluate(() => {
    document.getElementById("canvas").getContext("webgl2").getExtension("WEBGL_lose_context").loseContext();
  });
  await expect(page.locator("#picture")).toHaveAttribute("src", /^blob:/);
  await expect(page.locator("#card-look").getByLabel("Show", { exact: true })).toBeHidden();
  await expect(page.locator("#view")).toBeFocused();
  await expect.poll(() => page.workers().length).toBe(0);
  // The grid that comes now has no viewer any more.
  const drawn = page.waitForRequest(request => request.url().startsWith(`${url}/render.png`));
  release();
  await drawn;
});
