// Pictures of the page for the documents: node screenshots.mjs FOLDER [MESH]...
// Those of the samples are named after them; a mesh is dropped and voxelized at 512.
import { readFileSync } from "node:fs";
import { basename, join } from "node:path";
import { chromium } from "@playwright/test";
import { Daemon } from "./daemon.mjs";
import config from "./playwright.config.mjs";

const [folder, ...meshes] = process.argv.slice(2);
if (!folder) throw new Error("usage: node screenshots.mjs FOLDER [MESH]...");

const daemon = await new Daemon().start();
const browser = await chromium.launch(config.use.launchOptions);

async function open(viewport, colorScheme = "light") {
  const page = await browser.newPage({ viewport, colorScheme, reducedMotion: "reduce" });
  await page.goto(daemon.url);
  return page;
}

/** Waits until voxels of the size are shown at full resolution. */
async function settle(page, size) {
  await page.waitForFunction(
    side => new RegExp(`voxels, .*\\b${side}\\b(?!.*Preview)`).test(facts.textContent),
    size,
    { timeout: 120_000 },
  );
  await page.evaluate(() => banner.setAttribute("hidden", ""));
  await page.waitForTimeout(3000);
}

async function shoot(page, name) {
  await page.screenshot({ path: join(folder, `page-${name}.png`) });
  await page.close();
}

try {
  const desk = { width: 1120, height: 640 },
    phone = { width: 360, height: 640 };
  for (const [name, viewport, scheme] of [
    ["Rocket", desk, "light"],
    ["Planet", desk, "dark"],
    ["Knot", phone, "light"],
  ]) {
    const page = await open(viewport, scheme);
    await page.click(`.sample:has-text("${name}")`);
    await settle(page, 256);
    await shoot(page, name.toLowerCase());
  }
  for (const mesh of meshes) {
    const page = await open(desk);
    await page.setInputFiles("#files", {
      name: basename(mesh),
      mimeType: "application/octet-stream",
      buffer: readFileSync(mesh),
    });
    await page.waitForFunction(() =>
      document.querySelector("#card-model").textContent.includes("triangles"),
    );
    await page.fill("#size", "512");
    await page.press("#size", "Enter");
    await page.click("#run");
    await settle(page, 512);
    await shoot(page, basename(mesh).replace(/\.[^.]*$/, ""));
  }
  await shoot(await open(desk), "start");
} finally {
  await browser.close();
  await daemon.end();
}
