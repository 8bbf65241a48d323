"""Requests that a device must answer with the grids of the CPU: (file of voxeld_make_fixtures, options)."""

SIGNS = ("parity", "nonzero", "majority", "flood", "winding")
RULES = ("touch", "thin", "center")
COLORS = ("average", "nearest", "dominant", "shaded")
IDS = "color,normal,material,label,coverage"

# One tile, every feature.
FEATURES = [
    *[{"rule": rule, "channels": "occupancy"} for rule in RULES],
    *[{"color": color} for color in COLORS],
    {"channels": IDS},
    {"channels": "distance", "fill": "band", "thickness": "2"},
    *[{"fill": "solid", "sign": sign} for sign in SIGNS],
    {"fill": "shell", "thickness": "2"},
]
# Textures matter to colours alone.
TEXTURED = [*[{"color": color} for color in COLORS], {"channels": IDS}]
# Several tiles, and windows of items that are not the first.
LARGE = [
    *[{"rule": rule, "channels": "occupancy"} for rule in RULES],
    {"channels": "color,normal"},
    *[{"fill": "solid", "sign": sign, "channels": "occupancy"} for sign in SIGNS],
    {"fill": "shell", "thickness": "2", "channels": "occupancy"},
]

GRIDS = [
    *[("sample.glb", {"size": 80, **one}) for one in FEATURES],
    *[("sample.obj.zip", {"size": 80, **one}) for one in TEXTURED],
    *[("sample.obj.zip", {"size": 300, **one}) for one in TEXTURED],
    *[("sample.glb", {"size": 300, **one}) for one in LARGE],
    *[("sample.stl", {"size": 700, "channels": "occupancy", **one})
      for one in ({}, {"fill": "solid", "sign": "parity"}, {"fill": "solid", "sign": "majority"})],
    *[("concave.obj", {"size": 64, "fill": "solid", "sign": sign}) for sign in SIGNS],
    *[("sample.ply", {"size": 1, "channels": "color,normal"}), ("sample.ply", {"size": 2, "fill": "solid"})],
    *[("sample.off", {"size": size, "channels": "normal"}) for size in (33, 257, 513, 1024)],
]
QUICK_GRIDS = GRIDS[::7]

ANIMATIONS = [
    ("worm.md5.zip", {"size": 60, "animation": "walk", "fps": 8}),
    ("worm.md5.zip", {"size": 300, "animation": "walk", "fps": 3, "channels": "color,normal"}),
    ("spin.glb", {"size": 80, "animation": "0", "fps": 8, "fill": "solid"}),
]
QUICK_ANIMATIONS = ANIMATIONS[:1]

TIMED = [
    *[("sample.glb", {"size": size, "channels": "occupancy"}) for size in (256, 512, 1024)],
    *[("sample.glb", {"size": size, "channels": "color,normal"}) for size in (256, 512)],
    *[("sample.glb", {"size": size, "fill": "solid", "sign": "parity", "channels": "occupancy"})
      for size in (256, 512)],
]
