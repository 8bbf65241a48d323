// A daemon that goes away, breaks off, has another clock or another origin.
import http from "node:http";
import { join } from "node:path";
import { daemon, drop, expect, fixtures, LONG, resize, shown, test, told } from "./page.mjs";

test("after a restart of the daemon the page goes on", async ({ page }) => {
  await page.goto(daemon.url);
  await page.click('.sample:has-text("Knot")');
  await shown(page, 256);
  await daemon.stop("SIGKILL");
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await daemon.start();
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(page.locator("#banner")).toBeHidden();
});

test("a daemon that is back is noticed though nobody waits for it", async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await page.route("**/v1/**", route => route.abort());
  await resize(page, 96);
  await expect(page.locator("#offline")).toBeVisible();
  await page.click("#new");
  await page.unroute("**/v1/**");
  await expect(page.locator("#offline")).toBeHidden();
});

test("after 40 s without the daemon the page goes on", async ({ page }) => {
  // Waits are 50 times shorter. The page tries again after 0.4, 0.8, 1.5 and then every 2.5 s.
  await page.addInitScript(() => {
    const original = window.setTimeout;
    window.setTimeout = (call, ms, ...given) => original(call, ms >= 400 ? ms / 50 : ms, ...given);
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  let tries = 0,
    isAway = true;
  await page.route("**/v1/**", route => {
    ++tries;
    return isAway ? route.abort() : route.continue();
  });
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await expect.poll(() => tries).toBeGreaterThan(18); // 40 s
  isAway = false;
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(page.locator("#banner")).toBeHidden();
});

test("a problem that comes while the daemon is away stays when it is back", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  let isAway = true;
  await page.route("**/v1/**", route => (isAway ? route.abort() : route.continue()));
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  const banner = page.locator("#banner");
  await drop(page, join(fixtures, "bad/list.json"));
  await expect(banner).toContainText("None of these files is a mesh: list.json");
  isAway = false;
  await told(page, "The daemon answers again");
  await expect(banner).toContainText("None of these files is a mesh: list.json");
  await expect(banner).toBeVisible();
});

test("a problem stays while the daemon is away and when it is back", LONG, async ({ page }) => {
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await drop(page, join(fixtures, "bad/list.json"));
  const banner = page.locator("#banner"),
    text = "None of these files is a mesh: list.json";
  await expect(banner).toContainText(text);
  let isAway = true;
  await page.route("**/v1/**", route => (isAway ? route.abort() : route.continue()));
  await resize(page, 96);
  await expect(page.locator("#offline")).toContainText("does not answer");
  await expect(banner).toContainText(text);
  isAway = false;
  await shown(page, 96);
  await expect(page.locator("#offline")).toBeHidden();
  await expect(banner).toContainText(text);
  await expect(banner).toBeVisible();
});

test("a body that breaks off is asked for again", async ({ page }) => {
  let grids = 0;
  const proxy = http.createServer((request, response) => {
    const { method, headers, url } = request;
    const forwarded = http.request(daemon.url + url, { method, headers }, answer => {
      response.writeHead(answer.statusCode, answer.headers);
      if (!url.startsWith("/v1/grids/") || ++grids > 1) answer.pipe(response);
      else answer.once("data", () => response.write("VOXGRID", () => response.destroy()));
    });
    request.pipe(forwarded);
  });
  await new Promise(resolve => proxy.listen(0, "127.0.0.1", resolve));
  await page.goto(`http://127.0.0.1:${proxy.address().port}`);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  expect(grids).toBe(2);
  await expect(page.locator("#banner")).toBeHidden();
  proxy.close();
});

test("a proxy that has lost the daemon for a moment is asked again", async ({ page }) => {
  const refused = { submission: 502, events: 504 };
  await page.route("**/v1/jobs**", async route => {
    const request = route.request();
    const kind = request.url().endsWith("/events")
      ? "events"
      : request.method() === "POST" && !request.url().includes("dry_run")
        ? "submission"
        : "";
    const status = refused[kind];
    delete refused[kind];
    if (!status) return await route.continue();
    await route.fulfill({ status, contentType: "text/html", body: "<h1>Bad Gateway</h1>" });
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await shown(page, 256);
  await expect(page.locator("#banner")).toBeHidden();
  expect(refused.submission).toBe(undefined);
});

test("a clock that is five minutes late does not change what is told", async ({ page }) => {
  await page.addInitScript(() => {
    const now = Date.now;
    Date.now = () => now() - 300_000;
  });
  await page.goto(daemon.url);
  await drop(page, join(fixtures, "sample.ply"));
  await resize(page, 300);
  await expect(page.locator("#price")).toContainText("starts at once");
});

test("a page of another origin can neither post nor read", async ({ page }) => {
  const foreign = http.createServer((_, response) =>
    response.setHeader("Content-Type", "text/html").end("<p>elsewhere"),
  );
  await new Promise(resolve => foreign.listen(0, "127.0.0.1", resolve));
  await page.goto(`http://localhost:${foreign.address().port}/`);
  const before = (await daemon.json("/v1/assets")).assets.length;
  const outcome = await page.evaluate(async url => {
    const results = [];
    for (const mode of ["cors", "no-cors"]) {
      try {
        const response = await fetch(`${url}/v1/assets?filename=evil.obj`, {
          method: "POST",
          mode,
          body: "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
        });
        results.push(response.status);
      } catch {
        results.push("refused");
      }
    }
    return results;
  }, daemon.url);
  expect(outcome[0]).toBe("refused");
  expect((await daemon.json("/v1/assets")).assets.length).toBe(before);
  foreign.close();
});
