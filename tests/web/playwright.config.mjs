// Chromium of Debian, which draws by Mesa on the CPU: `gl-egl` takes a quarter of SwiftShader's time.
import { defineConfig } from "@playwright/test";

export default defineConfig({
  testMatch: "*.spec.mjs",
  workers: 1,
  timeout: 180_000, // for machines that others use, too
  expect: { timeout: 45_000 },
  reporter: "list",
  outputDir: "results",
  use: {
    contextOptions: { reducedMotion: "reduce" },
    viewport: { width: 880, height: 520 },
    launchOptions: {
      executablePath: "/usr/bin/chromium",
      args: [
        "--no-sandbox",
        "--disable-dev-shm-usage",
        "--use-angle=gl-egl",
        "--ignore-gpu-blocklist",
      ],
    },
  },
});
