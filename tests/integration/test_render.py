"""Images through the whole service. long/test_render_llvmpipe.py repeats this on a daemon with a GL context."""
import struct
import unittest
import zlib

import numpy as np

from harness import DaemonTest


def decode_png(data):
    """RGBA rows of an 8-bit, non-interlaced PNG (colour type 2 or 6)."""
    assert data[:8] == b"\x89PNG\r\n\x1a\n"
    width, height, depth, kind, _, _, interlace = struct.unpack(">IIBBBBB", data[16:29])
    assert depth == 8 and kind in (2, 6) and interlace == 0, (depth, kind, interlace)
    stream, position = b"", 8
    while position < len(data):
        size, name = struct.unpack(">I4s", data[position:position + 8])
        if name == b"IDAT":
            stream += data[position + 8:position + 8 + size]
        position += 12 + size
    channels = 4 if kind == 6 else 3
    rows = np.frombuffer(zlib.decompress(stream), np.uint8).reshape(height, 1 + width * channels).tolist()
    out, above = [], [0] * (width * channels)
    for kind_of_filter, *line in rows:
        row = []
        for x, value in enumerate(line):
            left = row[x - channels] if x >= channels else 0
            corner = above[x - channels] if x >= channels else 0
            if kind_of_filter == 0:
                guess = 0
            elif kind_of_filter == 1:
                guess = left
            elif kind_of_filter == 2:
                guess = above[x]
            elif kind_of_filter == 3:
                guess = (left + above[x]) // 2
            else:
                p = left + above[x] - corner
                a, b, c = abs(p - left), abs(p - above[x]), abs(p - corner)
                guess = left if a <= b and a <= c else above[x] if b <= c else corner
            row.append((value + guess) & 255)
        out.append(row)
        above = row
    pixels = np.array(out, np.uint8).reshape(height, width, channels)
    if channels == 3:
        pixels = np.concatenate([pixels, np.full((height, width, 1), 255, np.uint8)], axis=2)
    return pixels


class RenderTest(DaemonTest):
    def image(self, query, name="sample.glb"):
        response = self.daemon.post(f"/v1/render?size=48&width=96&height=96&filename={name}&{query}",
                                    self.fixture(name))
        self.assertEqual(response.status, 200, response.body)
        return decode_png(response.body)


class Render(RenderTest):
    """The ray march on the CPU, which auto also takes beside a software driver."""
    device = "cpu"

    def test_transparent_background_has_alpha_zero_in_the_corners(self):
        image = self.image("background=transparent")
        self.assertEqual(image[0, 0, 3], 0)
        self.assertGreater((image[..., 3] == 255).mean(), 0.1)

    def test_background_colour_is_exact(self):
        image = self.image("background=%23204060")
        self.assertEqual(list(image[0, 0, :3]), [0x20, 0x40, 0x60])

    def test_the_model_is_framed(self):
        for query in ("projection=perspective", "projection=orthographic", "azimuth=200&elevation=-40"):
            solid = self.image(query + "&style=smooth&background=transparent")[..., 3] > 0
            rows, columns = np.nonzero(solid)
            self.assertGreater(rows.min(), 0, query)
            self.assertLess(rows.max(), 95, query)
            self.assertGreaterEqual(max(np.ptp(rows), np.ptp(columns)) + 1, 0.85 * 96, query)

    def test_views_differ_and_zoom_enlarges(self):
        near = self.image("zoom=2&background=transparent&ground=no")
        far = self.image("zoom=0.5&background=transparent&ground=no")
        self.assertGreater((near[..., 3] > 0).sum(), 2 * (far[..., 3] > 0).sum())
        self.assertTrue((self.image("azimuth=0") != self.image("azimuth=90")).any())
        self.assertTrue((self.image("style=iso") != self.image("style=smooth")).any())

    def test_occlusion_and_shadow_darken_and_move_nothing(self):
        plain = self.image("style=smooth&background=transparent").astype(int)
        for option in ("occlusion=yes", "shadow=yes"):
            other = self.image("style=smooth&background=transparent&" + option).astype(int)
            self.assertTrue((other[..., 3] == plain[..., 3]).all(), option)
            self.assertTrue((other[..., :3] <= plain[..., :3] + 1).all(), option)
            self.assertTrue((other[..., :3] < plain[..., :3] - 10).any(), option)

    def test_styles_have_backgrounds_of_their_own(self):
        voxel, smooth, blueprint = (self.image("style=" + style)
                                    for style in ("voxel", "smooth", "blueprint"))
        self.assertEqual(list(smooth[0, 0]), [255, 255, 255, 255])
        self.assertLess(voxel[95, 0, 0], voxel[0, 0, 0])  # a gradient
        self.assertGreater(blueprint[0, 0, 2], blueprint[0, 0, 0] + 60)
        self.assertTrue((self.image("") == voxel).all())
        clay, iso = self.image("style=clay").astype(int), self.image("style=iso").astype(int)
        self.assertFalse((clay == iso).all())
        # Clay has no colours: the model has those of the neutral tone.
        clay = self.image("style=clay&background=transparent&samples=1&ground=no").astype(int)
        solid = clay[clay[..., 3] == 255]
        self.assertGreater(len(solid), 500)
        self.assertTrue((solid[:, 0] >= solid[:, 2]).all())

    def test_the_ground_is_a_shadow_on_what_is_behind(self):
        with_ground = self.image("background=transparent&zoom=0.7").astype(int)
        without = self.image("background=transparent&zoom=0.7&ground=no").astype(int)
        solid = without[..., 3] == 255
        self.assertTrue((with_ground[solid] == without[solid]).all())
        shade = (with_ground[..., 3] > 30) & (without[..., 3] == 0)
        self.assertGreater(shade.sum(), 40)
        self.assertLess(with_ground[shade][:, :3].max(), 90)  # dark

    def test_a_turntable_neither_jumps_nor_clips(self):
        sheet = self.daemon.post("/v1/render?size=48&width=64&height=64&style=smooth&filename=sample.glb"
                                 "&background=transparent&image=sheet&turntable=6&columns=6",
                                 self.fixture("sample.glb"))
        self.assertEqual(sheet.status, 200, sheet.body)
        solid = decode_png(sheet.body)[..., 3] > 0
        tops, bottoms = [], []
        for view in range(6):
            rows, columns = np.nonzero(solid[:, 64 * view:64 * view + 64])
            self.assertGreater(columns.min(), 0, view)
            self.assertLess(columns.max(), 63, view)
            tops.append(rows.min())
            bottoms.append(rows.max())
        # The tip of the rocket is on the axis.
        self.assertLessEqual(np.ptp(tops), 1)
        self.assertGreaterEqual(max(bottoms) - min(tops) + 1, 0.85 * 64)

    def test_more_rays_smooth_edges_and_move_nothing(self):
        jagged = self.image("background=transparent&ground=no&samples=1").astype(int)
        smooth = self.image("background=transparent&ground=no&samples=4").astype(int)
        self.assertEqual(set(np.unique(jagged[..., 3])), {0, 255})
        self.assertGreater(len(np.unique(smooth[..., 3])), 8)
        self.assertTrue((self.image("background=transparent") == self.image("background=transparent&samples=2")).all())
        self.assertLess(abs(jagged[..., 3].mean() - smooth[..., 3].mean()), 2)

    def test_a_section_plane_cuts_away(self):
        whole = self.image("background=transparent&projection=orthographic&azimuth=0&elevation=0")
        cut = self.image("background=transparent&projection=orthographic&azimuth=0&elevation=0"
                           "&section=0,1,0,-1e9")
        self.assertTrue((whole == cut).all())
        gone = self.image("background=transparent&section=0,1,0,1e9")
        self.assertEqual((gone[..., 3] > 0).sum(), 0)

    def test_from_asset_and_grid_as_from_the_request(self):
        asset = self.daemon.upload(self.fixtures / "sample.glb")
        direct = self.daemon.post("/v1/render?size=40&width=64&height=64&filename=sample.glb",
                                  self.fixture("sample.glb"))
        from_asset = self.daemon.post(f"/v1/render?size=40&width=64&height=64&asset={asset}")
        self.assertEqual(direct.body, from_asset.body)
        grid = direct.headers["X-Voxeld-Grid"]
        from_grid = self.daemon.post(f"/v1/render?width=64&height=64&grid={grid}")
        self.assertEqual(direct.body, from_grid.body)

    def test_the_largest_image(self):
        response = self.daemon.post(
            "/v1/render?size=16&width=4096&height=4096&occlusion=no&shadow=no&filename=sample.glb",
            self.fixture("sample.glb"))
        self.assertEqual(response.status, 200)
        self.assertEqual(struct.unpack(">II", response.body[16:24]), (4096, 4096))


class RendererOnCpu(RenderTest):
    device = "cpu"

    def test_gl_is_refused(self):
        self.assertTrue((self.image("renderer=cpu") == self.image("")).all())
        refused = self.daemon.post("/v1/render?renderer=gl&filename=sample.glb", self.fixture("sample.glb"))
        self.assertEqual(refused.status, 422, refused.body)
        self.assertIn("renderer gl needs a GL context", refused.body.decode())


class RendererOnLlvmpipe(RenderTest):
    def test_both_renderers_draw_the_same(self):
        by_cpu = self.image("renderer=cpu").astype(int)
        self.assertTrue((by_cpu == self.image("")).all())  # auto, on software drivers
        by_gl = self.image("renderer=gl").astype(int)
        self.assertLessEqual((abs(by_gl - by_cpu) > 2).any(axis=2).mean(), 0.001)


if __name__ == "__main__":
    unittest.main()
