// Access: assistive technology, narrow screens, keyboards, keys of the daemon, the activity page.
import { readFileSync } from "node:fs";
import { createRequire } from "node:module";
import { join } from "node:path";
import { Daemon } from "./daemon.mjs";
import { daemon, expect, fixtures, LONG, resize, shown, test, told } from "./page.mjs";

const axe = readFileSync(createRequire(import.meta.url).resolve("axe-core/axe.min.js"), "utf8");

async function seriousFindings(page) {
  await page.evaluate(axe);
  const results = await page.evaluate(() =>
    window.axe.run({ runOnly: ["wcag2a", "wcag2aa", "wcag21a", "wcag21aa", "best-practice"] }),
  );
  return results.violations
    .filter(one => one.impact === "serious" || one.impact === "critical")
    .map(
      one =>
        `${one.id}: ${one.nodes
          .map(node => node.target + " " + node.failureSummary)
          .join("; ")
          .slice(0, 400)}`,
    );
}

test("no serious findings of axe-core: start, voxels, activity, light and dark", async ({
  page,
}) => {
  const check = async () => {
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
      expect(await seriousFindings(page), colorScheme).toEqual([]);
    }
  };
  await page.goto(daemon.url);
  await check();
  await page.click('.sample:has-text("Worm")');
  await shown(page, 128);
  for (const summary of await page.locator("#panel summary").all()) await summary.click();
  await check();
  await page.goto(`${daemon.url}/admin`);
  await expect(page.locator("#admin")).toContainText("worm.glb");
  await expect(page.locator("#admin")).toContainText(/Memory.* MB.* of all tenants; .*B of .*B free/s);
  await check();
});

test("a phone's width needs no sideways scrolling, and all works by keyboard", LONG, async ({ page }) => {
  await page.setViewportSize({ width: 360, height: 740 });
  await page.goto(daemon.url);
  await page.focus('.sample:has-text("Rocket")');
  await page.keyboard.press("Enter");
  await shown(page, 256);
  await expect(page.locator("#view")).toBeFocused();
  for (const summary of await page.locator("#panel summary").all()) await summary.click();
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(360);
  await page.focus("#size-slider");
  await page.keyboard.press("ArrowLeft");
  await expect(page.locator("#size")).toHaveValue("128");
  await shown(page, 128);
  await expect(page.locator("#size-slider")).toBeFocused();
  const price = await page.textContent("#price");
  await page.keyboard.press("End"); // a job that waits for a click
  await expect(page.locator("#price")).not.toHaveText(price);
  await expect(page.locator("#size-slider")).toBeFocused();
  await page.focus("#new");
  await page.keyboard.press("Enter");
  await expect(page.locator("#files")).toBeFocused();
  await page.goto(`${daemon.url}/admin`);
  expect(await page.evaluate(() => document.documentElement.scrollWidth)).toBeLessThanOrEqual(360);
  const queue = () => page.waitForResponse(response => response.url().includes("/v1/queue"));
  const devices = page.locator("#admin .scroll").first();
  await devices.focus();
  for (let i = 0; i < 3; ++i) await queue(); // one may be under way, and one is shown for sure
  await expect(devices).toBeFocused();
});

test("a table keeps the focus while its rows change, and shows more of them", LONG, async ({ page }) => {
  let ids = ["j-1", "j-2", "j-3"],
    done = 1,
    hasMore = true,
    release = () => undefined;
  const held = new Promise(resolve => (release = resolve));
  const limits = [],
    cancelled = [];
  await page.route("**/v1/queue?*", async route => {
    const limit = Number(new URL(route.request().url()).searchParams.get("limit"));
    limits.push(limit);
    const response = await route.fetch();
    const common = { filename: "same.ply", state: "running", tiles_done: done, tiles_total: 9 };
    const jobs = ids.map(id => ({ id, ...common, frames_total: 0, tenant: "", device: "cpu" }));
    const next = hasMore ? { next: "others" } : {};
    if (limit === 1000) await held;
    await route.fulfill({ response, json: { ...(await response.json()), jobs, ...next } });
  });
  await page.route("**/v1/jobs/j-*", async route => {
    cancelled.push(route.request().url().split("/").pop());
    ids = ["j-0", "j-3"];
    await route.fulfill({ json: {} });
  });
  await page.goto(`${daemon.url}/admin`);
  const card = page.locator('section:has(h2:text-is("Queue"))'),
    rows = card.locator("tbody tr"),
    button = card.locator("[data-mark]");
  await expect(rows).toHaveCount(3);
  await rows.nth(1).getByRole("button").evaluate(button => {
    button.dataset.mark = "";
    button.focus();
  });
  done = 7;
  await expect(rows.nth(1)).toContainText("7 of 9 tiles");
  await expect(button).toBeFocused();
  ids = ["j-2", "j-3"];
  await expect(rows).toHaveCount(2);
  await expect(button).toBeFocused();
  ids = ["j-0", "j-2", "j-3"];
  await expect(rows).toHaveCount(3);
  await expect(button).toBeFocused();
  // A row that moves loses the focus for a moment; the page stays where it is scrolled to.
  await page.setViewportSize({ width: 880, height: 200 });
  await page.evaluate(() => scrollTo(0, document.body.scrollHeight));
  const place = await page.evaluate(() => scrollY);
  expect(place).toBeGreaterThan(200);
  ids = ["j-2", "j-0", "j-3"];
  await expect(rows.first().locator("[data-mark]")).toBeFocused();
  expect(await page.evaluate(() => scrollY)).toBe(place);
  await page.keyboard.press("Enter");
  await expect(rows).toHaveCount(2);
  expect(cancelled).toEqual(["j-2"]);
  await expect(card.locator("h2")).toBeFocused();
  expect(new Set(limits)).toEqual(new Set([50]));
  const more = card.getByRole("button", { name: "Show more" });
  await more.focus();
  hasMore = false;
  await expect(more).toBeHidden();
  await expect(card.locator("h2")).toBeFocused();
  hasMore = true;
  await more.click();
  await expect.poll(() => limits).toContain(1000);
  await expect(more).toBeVisible();
  ids = Array.from({ length: 60 }, (_, i) => `j-${i}`);
  release();
  await expect(rows).toHaveCount(60);
  await expect(more).toBeHidden();
  await expect(card.locator(".scroll")).toBeFocused();
});

test("a mesh of several tenants has a row for each of them", async ({ page }) => {
  const row = (id, filename) => ({ id: `sha256-${id}`, filename, bytes: 1, created_ms: 0 });
  const before = [row("a", "twin.ply"), row("a", "twin.ply"), row("a", "other.ply"), row("b", "b.ply")];
  const after = [row("a", "other.ply"), row("a", "twin.ply"), row("a", "twin.ply"), row("a", "twin.ply")];
  let assets = before;
  await page.route("**/v1/assets?*", route => route.fulfill({ json: { assets } }));
  await page.route("**/v1/assets/*", async route => {
    assets = after;
    await route.fulfill({ json: {} });
  });
  await page.goto(`${daemon.url}/admin`);
  const rows = page.locator('h3:text-is("Meshes") + .stack tbody tr');
  const names = of => of.map(one => one.filename);
  const buttons = () =>
    rows.getByRole("button").evaluateAll(all => all.map(one => one.ariaLabel.replace("Delete: ", "")));
  await expect(rows.locator("td:first-child")).toHaveText(names(before));
  expect(await buttons()).toEqual(names(before));
  await page.click('button[aria-label="Delete: b.ply"]');
  await expect(rows.locator("td:first-child")).toHaveText(names(after));
  expect(await buttons()).toEqual(names(after));
});

test.describe("with keys", () => {
  let locked, key;
  test.beforeAll(async () => {
    locked = new Daemon();
    key = locked.keys("add", "lab");
    await locked.start();
  });
  test.afterAll(() => locked?.end());

  const giveKey = async (page, text) => {
    await page.fill("#key", text);
    await page.keyboard.press("Enter");
  };

  const statusOf = async text =>
    (await fetch(`${locked.url}/v1/me`, { headers: { Authorization: `Bearer ${text}` } })).status;

  test("a key is asked for, kept for the tab if wished, and never in a URL", async ({ page }) => {
    const urls = [];
    page.on("request", request => urls.push(request.url()));
    await page.goto(locked.url);
    await giveKey(page, "vxk_wrong");
    await expect(page.locator("dialog")).toContainText("unknown, expired or revoked");
    await page.check("dialog input[type=checkbox]");
    await giveKey(page, key);
    await expect(page.locator("dialog")).toBeHidden();
    await expect(page.locator("#keys")).toHaveText("Key of lab");
    await page.click('.sample:has-text("Rocket")');
    await shown(page, 256);
    await page.reload();
    await expect(page.locator("#keys")).toHaveText("Key of lab");
    await page.click("#keys"); // forgets it
    await expect(page.locator("dialog")).toBeVisible();
    expect(await page.evaluate(() => ({ ...sessionStorage, ...localStorage }))).toEqual({});
    expect(urls.filter(url => url.includes(key))).toEqual([]);
  });

  test("without a key the dialog stays, and a key that no header takes is refused", async ({
    page,
  }) => {
    await page.addInitScript(() => {
      if (!window.name) sessionStorage.setItem("voxeld-key", "schlüssel");
      window.name = "visited";
    });
    await page.goto(locked.url);
    const input = page.locator("#key");
    for (let i = 0; i < 3; ++i) {
      await expect(input).toBeFocused();
      await page.keyboard.press("Escape");
    }
    await expect(input).toBeFocused();
    expect(await page.evaluate(() => sessionStorage.length)).toBe(0);
    await giveKey(page, "schlüssel");
    expect(await input.evaluate(element => element.validationMessage)).toContain("ASCII");
    await expect(page.locator("#banner")).toBeHidden();
    await giveKey(page, key);
    await expect(page.locator("#keys")).toHaveText("Key of lab");
  });

  test("a key that is revoked meanwhile is asked for anew, and the work goes on", async ({
    page,
  }) => {
    const brief = locked.keys("add", "brief");
    await page.goto(locked.url);
    await giveKey(page, brief);
    await page.click('.sample:has-text("Knot")');
    await shown(page, 256);
    locked.keys("revoke", brief.split("_")[1]);
    await expect.poll(() => statusOf(brief)).toBe(401); // the daemon has read its keys again
    const next = locked.keys("add", "brief");
    await expect.poll(() => statusOf(next)).toBe(200);
    await resize(page, 80);
    await expect(page.locator("dialog")).toContainText("revoked");
    await giveKey(page, next);
    await shown(page, 80);
  });

  test("a tenant sees its own jobs and storage, an admin all", async ({ page }) => {
    const stored = await fetch(`${locked.url}/v1/assets?filename=own.ply`, {
      method: "POST",
      headers: { Authorization: `Bearer ${key}` },
      body: readFileSync(join(fixtures, "sample.ply")),
    });
    expect(stored.ok).toBe(true);
    await page.goto(`${locked.url}/admin`);
    await giveKey(page, locked.keys("add", "other"));
    await expect(page.locator("#admin")).toContainText("your own jobs and storage");
    await expect(page.locator("#admin")).not.toContainText("own.ply");
    await page.reload();
    await giveKey(page, locked.keys("add", "boss", "--admin"));
    await expect(page.locator("#admin")).toContainText("every tenant");
    await expect(page.locator("#admin")).toContainText("own.ply");
    await page.click('button[aria-label="Delete: own.ply"]');
    await told(page, "own.ply and its results are deleted");
    await expect(page.locator('button[aria-label="Delete: own.ply"]')).toHaveCount(0);
    await expect(page.locator('h2:text-is("Storage")')).toBeFocused();
  });

  test("an admin adds a key that is shown once, and revokes it; a tenant sees no keys", async ({
    page,
  }) => {
    await page.goto(`${locked.url}/admin`);
    await giveKey(page, locked.keys("add", "plain"));
    await expect(page.locator("#admin")).toContainText("your own jobs and storage");
    const card = page.locator('section:has(h2:text-is("Keys"))');
    await expect(card).toBeHidden();
    await page.reload();
    await giveKey(page, locked.keys("add", "head", "--admin"));
    await card.getByLabel("Name", { exact: true }).fill("guest");
    await card.getByLabel("Expires").fill("soon");
    await page.keyboard.press("Enter");
    await expect(page.locator("#banner")).toContainText("30d");
    await card.getByLabel("Expires").fill("30d");
    await card.getByLabel("Requests").fill("10/s");
    await card.getByLabel("Stored bytes").fill("20000000");
    await card.getByRole("button", { name: "Add", exact: true }).click();
    const shownKey = card.getByLabel("Key, shown only now");
    await expect(shownKey).toHaveValue(/^vxk_[a-z2-7]{8}_[a-z2-7]{52}$/);
    await expect(shownKey).toBeFocused();
    const added = await shownKey.inputValue();
    expect(await statusOf(added)).toBe(200);
    const row = card.locator(`tr:has-text("guest ${added.split("_")[1]}")`);
    await expect(row).toContainText(/Tenant.*Stored bytes: 20.*Requests a minute: 600.*live/);
    for (const colorScheme of ["light", "dark"]) {
      await page.emulateMedia({ colorScheme, reducedMotion: "reduce" });
      expect(await seriousFindings(page), colorScheme).toEqual([]);
    }
    // A key whose response is lost is not made twice.
    const posts = [];
    const isPost = request => request.method() === "POST";
    await page.route("**/v1/keys", async route => {
      if (!isPost(route.request())) return await route.continue();
      posts.push(await route.fetch());
      await route.abort("connectionreset");
    });
    await card.getByLabel("Name", { exact: true }).fill("lost");
    const lost = page.waitForEvent("requestfailed", isPost);
    await card.getByRole("button", { name: "Add", exact: true }).click();
    await lost;
    await expect(page.locator("#banner")).not.toContainText("30d"); // that of the first error
    await page.unroute("**/v1/keys");
    expect(posts.map(response => response.status())).toEqual([201]);
    await row.getByRole("button", { name: "Revoke" }).click();
    await expect(row).toContainText("revoked");
    await expect(row.getByRole("button")).toHaveCount(0);
    await expect(card.locator("h2")).toBeFocused();
    expect(await statusOf(added)).toBe(401);
  });
});
