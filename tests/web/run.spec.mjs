// Runs that are superseded, cancelled or left, and what is deleted.
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import { daemon, drop, expect, fixtures, LONG, resize, shown, test, told } from "./page.mjs";

/** A mesh of 500 squares in nearly one place: its largest grid takes minutes on any machine, a small one no time. */
function sheets() {
  const path = join(fixtures, "sheets.obj");
  const square = z => `v 0 0 ${z}\nv 1 0 ${z}\nv 0 1 ${z}\nv 1 1 ${z}\nf -4 -3 -2\nf -2 -3 -1\n`;
  writeFileSync(path, Array.from({ length: 500 }, (_, i) => square(i / 1e6)).join(""));
  return path;
}

/** Starts a run that takes longer than its test, and waits until its preview is over. */
async function startLongRun(page) {
  await page.goto(daemon.url);
  await drop(page, sheets());
  await shown(page, 256);
  await resize(page, 16384);
  await page.click("#run");
  await expect(page.locator("#job")).toHaveText(/^(Voxelizing|Waiting)/); // behind the preview
  await expect(page.locator("#card-take button.primary")).toBeDisabled(); // it is of the grid before
}

test("a channel that is added leaves the others", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.locator(".checks").evaluate(checks => (checks.closest("details").open = true));
  const box = name => page.locator(".checks label", { hasText: name }).locator("input");
  await expect(box("Colour")).toBeChecked();
  await box("Normal").check();
  await expect(page.locator("#commands pre")).toContainText("channels=occupancy%2Ccolor%2Cnormal");
  await box("Colour").uncheck();
  await expect(page.locator("#commands pre")).toContainText("channels=occupancy%2Cnormal");
});

test("a thickness that is emptied is that of the daemon again", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 32);
  await shown(page, 32);
  const thickness = page.getByLabel("Thickness"),
    command = page.locator("#commands pre");
  await page.check('#card-voxels input[value="band"]', { force: true });
  await expect(thickness).toHaveValue("3");
  await thickness.fill("2");
  await thickness.press("Enter");
  await expect(command).toContainText("thickness=2");
  await thickness.fill("");
  await thickness.press("Enter");
  await expect(thickness).toHaveValue("3");
  await expect(command).toHaveText(/fill=band(?!.*thickness)/);
});

test("a job of a superseded setting is cancelled, and cancel ends the last", async ({ page }) => {
  await startLongRun(page);
  await expect(page.locator("#cancel")).toBeVisible();
  await expect(page.locator("#price")).toContainText("memory");
  await resize(page, 16000);
  await expect
    .poll(async () =>
      (await daemon.json("/v1/jobs?state=cancelled")).jobs.map(job => job.options?.size),
    )
    .toContain(16384);
  await page.click("#run");
  await page.click("#cancel");
  await expect(page.locator("#job")).toHaveText("Cancelled.");
  await expect(page.locator("#cancel")).toBeHidden();
});

test("a preview that is superseded is cancelled, known to the page or not", async ({ page }) => {
  const previews = []; // that are made so large that they are superseded
  let release = () => undefined;
  await page.route("**/v1/jobs", async route => {
    const body = route.request().postDataJSON();
    if (body?.options?.size !== 128 || body.priority !== 10) return await route.continue();
    const response = await route.fetch({
      postData: JSON.stringify({ ...body, options: { ...body.options, size: 16384 } }),
      timeout: 0,
    });
    previews.push((await response.json()).id);
    if (previews.length === 2) await new Promise(resolve => (release = resolve));
    await route.fulfill({ response });
  });
  const start = async size => {
    await resize(page, size);
    await page.click("#run");
  };
  const cancelled = async () =>
    (await daemon.json("/v1/jobs?state=cancelled&limit=100")).jobs.map(job => job.id);
  await page.goto(daemon.url);
  await drop(page, sheets());
  await resize(page, 64);
  await shown(page, 64);
  await start(3000);
  await expect(page.locator("#job")).toHaveText(/^Preview/);
  await start(3001); // supersedes a preview that runs
  await expect.poll(cancelled).toContain(previews[0]);
  await expect.poll(() => previews.length).toBe(2);
  const priced = page.waitForResponse(response => response.url().includes("dry_run"));
  await page.fill("#size", "64"); // supersedes one whose request is under way
  await page.press("#size", "Enter");
  await priced;
  release();
  await expect.poll(cancelled).toContain(previews[1]);
  await shown(page, 64);
});

test("a change of the settings supersedes a run whose price is asked for", LONG, async ({ page }) => {
  // The price of the new settings, which would supersede it later, is never asked for.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => (ms === 140 ? 0 : original(call, ms, ...given));
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await expect(page.locator("#card-take")).toContainText("about"); // the first run has ended
  await page.route(/dry_run/, () => undefined); // no response
  const asked = page.waitForRequest(/dry_run/);
  await page.click("#run");
  await asked;
  const given = page.waitForEvent("requestfailed", request => request.url().includes("dry_run"));
  await resize(page, 64);
  await given;
});

test("cancel ends a run whose price is asked for", LONG, async ({ page }) => {
  await startLongRun(page);
  await page.route(/dry_run/, () => undefined); // no response
  const asked = page.waitForRequest(/dry_run/);
  await page.click("#run");
  await asked;
  const given = page.waitForEvent("requestfailed", request => request.url().includes("dry_run"));
  await page.click("#cancel");
  await given;
  await expect(page.locator("#job")).toHaveText("Cancelled.");
});

test("a run that is left before it has submitted a job submits none", LONG, async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const isCancel = request => request.method() === "DELETE";
  await page.route("**/v1/jobs/*", async route => {
    if (isCancel(route.request())) await held;
    await route.continue();
  });
  await startLongRun(page);
  const asked = page.waitForRequest(isCancel);
  await page.click("#run"); // waits until the job before it is cancelled
  await asked;
  const sent = [];
  page.on("request", request => {
    if (request.method() === "POST") sent.push(request.url());
  });
  await page.click("#new");
  const came = page.waitForResponse(response => isCancel(response.request()));
  release();
  await came;
  // Another response: the run has ended by then.
  await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
  expect(sent).toEqual([]);
});

test("delete removes the mesh and its results", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "concave.obj"));
  await shown(page, 256);
  const { assets } = await daemon.json("/v1/assets");
  const asset = assets.find(one => one.filename === "concave.obj");
  const results = async () => (await daemon.json("/v1/results")).results.map(one => one.filename);
  expect(await results()).toContain("concave.voxg");
  await page.click("#delete");
  await told(page, "concave and its results are deleted");
  await expect(page.locator("#start")).toBeVisible();
  expect((await fetch(`${daemon.url}/v1/assets/${asset.id}?brief=1`)).status).toBe(410);
  expect(await results()).not.toContain("concave.voxg");
});

test("a mesh that is given again while it is deleted is uploaded again", async ({ page }) => {
  let release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const steps = [];
  await page.route("**/v1/**", async route => {
    const request = route.request();
    if (request.url().includes("brief=1")) steps.push("asked");
    if (request.method() !== "DELETE") return await route.continue();
    await held;
    const response = await route.fetch();
    steps.push("deleted");
    await route.fulfill({ response });
  });
  const mesh = join(fixtures, "concave.obj");
  await page.goto(daemon.url);
  await drop(page, mesh);
  await shown(page, 256);
  steps.length = 0;
  await page.click("#delete");
  await drop(page, mesh);
  await expect(page.locator("#card-model h2")).toHaveText("concave");
  // Other responses: a page that does not wait has asked for the mesh by then.
  await page.evaluate(async () => {
    for (let i = 0; i < 3; ++i) await (await (await fetch("/v1/me")).blob()).arrayBuffer();
  });
  await expect(page.locator("#over")).toContainText("concave.obj");
  expect(steps).toEqual([]);
  release();
  await told(page, "concave and its results are deleted");
  await shown(page, 256);
  expect(new Set(steps.slice(0, -1))).toEqual(new Set(["deleted"]));
  expect(steps.at(-1)).toBe("asked");
  await expect(page.locator("#banner")).toBeHidden();
});

test("a deletion that fails is told, and keeps no mesh away", async ({ page }) => {
  const problem = { status: 500, json: { code: "internal", detail: "the disk is gone" } };
  await page.route("**/v1/assets/*", route =>
    route.request().method() === "DELETE" ? route.fulfill(problem) : route.continue(),
  );
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.click("#delete");
  await expect(page.locator("#banner")).toContainText("the disk is gone");
  await drop(page, join(fixtures, "concave.obj"));
  await shown(page, 256);
  await expect(page.locator("#banner")).toBeHidden();
});

test("delete waits until the job that runs is cancelled", async ({ page }) => {
  await startLongRun(page);
  const steps = [];
  await page.route("**/v1/**", async route => {
    const request = route.request();
    if (request.method() !== "DELETE") return await route.continue();
    if (!/\/v1\/jobs\/[^/]*$/.test(request.url())) {
      steps.push("delete");
      return await route.continue();
    }
    const response = await route.fetch();
    // Another response: a page that does not wait has asked for more by then.
    await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
    steps.push("cancelled");
    await route.fulfill({ response });
  });
  await page.click("#delete");
  await told(page, "sheets and its results are deleted");
  expect(steps.slice(0, 2)).toEqual(["cancelled", "delete"]);
});

test("delete cancels an export that runs, and waits for it", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#card-take")).toContainText("about"); // the result to take
  const job = { id: "export", kind: "export", state: "running" }; // it has no events
  const steps = [];
  await page.route("**/v1/jobs", route => route.fulfill({ json: job }));
  await page.route("**/v1/jobs/export/events", () => undefined);
  await page.route("**/v1/**", async route => {
    const request = route.request();
    if (request.method() !== "DELETE") return await route.fallback();
    if (!/\/v1\/jobs\/[^/]*$/.test(request.url())) {
      steps.push("delete");
      return await route.continue();
    }
    // Another response: a page that does not wait has asked for more by then.
    await page.evaluate(async () => (await (await fetch("/v1/me")).blob()).arrayBuffer());
    steps.push("cancelled");
    await route.fulfill({ json: { ...job, state: "cancelled" } });
  });
  const asked = page.waitForRequest("**/v1/jobs/export/events");
  await page.click("#card-take button.primary");
  await asked;
  await page.click("#delete");
  await told(page, "sample and its results are deleted");
  expect(steps.slice(0, 2)).toEqual(["cancelled", "delete"]);
  await expect(page.locator("#banner")).toBeHidden();
});

/** A container of the first tiles of another; without channels or meta it has them all in order. */
function firstTiles(container, count) {
  const header = Buffer.from(container.subarray(0, 128));
  const channels = [0, 1, 2, 3, 4, 5].filter(i => header.readUInt32LE(12) & (1 << i)).length;
  const entryBytes = (36 + 4 * channels + 7) & ~7,
    all = header.readUInt32LE(80);
  const first = 128 + Math.ceil(header.readUInt32LE(84) / 8) * 8,
    shift = (all - count) * entryBytes; // that the streams move
  const entries = Buffer.from(container.subarray(first, first + count * entryBytes));
  let voxels = 0n,
    end = 0;
  for (let at = 0; at < entries.length; at += entryBytes) {
    voxels += entries.readBigUInt64LE(at + 16);
    end = Number(entries.readBigUInt64LE(at + 24));
    entries.writeBigUInt64LE(BigInt(end - shift), at + 24);
    for (let i = 0; i <= channels; ++i) end += entries.readUInt32LE(at + 32 + 4 * i);
  }
  const streams = container.subarray(first + all * entryBytes, end);
  header.writeUInt32LE(count, 80);
  header.writeBigUInt64LE(voxels, 88);
  header.writeBigUInt64LE(BigInt(end - shift), 96);
  return Buffer.concat([header, container.subarray(128, first), entries, streams]);
}

test("a grid shows as it grows", async ({ page }) => {
  let isReleased = false,
    running;
  const asked = [];
  await page.route("**/v1/jobs", async route => {
    const response = await route.fetch();
    const job = await response.json();
    if (job.options?.size === 1000) running = { ...job, state: "running", tiles_total: 50 };
    await route.fulfill({ response });
  });
  const isHeld = url => running && !isReleased && url.includes(running.id);
  // The job has one more tile each time that its state is asked for, until it is released.
  await page.route(/v1\/jobs\/[^/]*(\/events)?$/, async route => {
    const url = route.request().url();
    if (!isHeld(url)) return await route.continue();
    if (url.endsWith("/events")) return await route.fulfill({ body: "" });
    ++running.tiles_done;
    await route.fulfill({ json: running });
  });
  await page.route("**/tiles?after=*", async route => {
    const after = Number(/after=(\d+)/.exec(route.request().url())[1]);
    asked.push(after);
    if (after > 0) return await route.fulfill({ status: 202, json: running });
    while ((await daemon.json(`/v1/jobs/${running.id}`)).state !== "done");
    const response = await route.fetch(),
      body = firstTiles(await response.body(), 3);
    await route.fulfill({ body, headers: { "X-Voxeld-Next": "3" } });
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.check('#card-look input[value="x"]', { force: true });
  await resize(page, 1000);
  await page.click("#run");
  await expect(page.locator("#facts")).toContainText("Preview");
  // Cells of the grid that is wanted, of which some are the preview's.
  await expect(page.locator("#card-look output[for=cut]")).toHaveText(/^\d+ \/ (1000|[4-9]\d\d)$/);
  await expect(page.locator("#facts")).toContainText("Preview");
  const box = await page.locator("#canvas").boundingBox();
  const cells = [];
  for (let i = 1; i < 20; ++i) {
    await page.mouse.move(box.x + (box.width * i) / 20, box.y + box.height / 2);
    if (await page.locator("#pick").isHidden()) continue;
    const text = await page.locator("#pick").textContent();
    cells.push(...text.match(/cell (\d+), (\d+), (\d+)/).slice(1).map(Number));
  }
  expect(Math.max(...cells)).toBeGreaterThan(300);
  await expect.poll(() => asked).toContain(3);
  isReleased = true;
  await shown(page, 1000);
});

test("two tabs work beside each other", async ({ page, context }) => {
  const other = await context.newPage();
  await Promise.all([page.goto(daemon.url), other.goto(daemon.url)]);
  await Promise.all([
    page.click('.sample:has-text("Rocket")'),
    other.click('.sample:has-text("Knot")'),
  ]);
  await Promise.all([shown(page, 256), shown(other, 256)]);
  await other.close();
});
