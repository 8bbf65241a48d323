"""openapi.yaml against the daemon: schemas of options accept what it accepts, and routes take the parameters that they
list."""
import json
import random
import re
import unittest
import urllib.parse

from harness import ROOT, DaemonTest

# Settings that an option needs so that nothing but its value can be wrong.
CONTEXT = {
    "sign": {"fill": "solid"}, "thickness": {"fill": "shell"}, "interior": {"fill": "solid"},
    "rule": {"fill": "solid"}, "labels": {"channels": ["label"]}, "distance": {"channels": ["distance"]},
    "layout": {"format": "npz"},
    "mesh": {"format": "glb"}, "compress": {"format": "glb"}, "channel": {"format": "nrrd"},
    "blocks": {"format": "litematic"}, "dither": {"format": "vox"}, "schem_version": {"format": "schem"},
    "zarr_version": {"format": "zarr"}, "neighbors": {"keep": "largest"}, "remap": {"channels": ["label"]},
    "padding": {"voxel_size": 1},
    "root_motion": {"animation": "0"}, "frame": {"animation": "0"}, "image": {"turntable": 4},
    "turntable": {"image": "gif"}, "rate": {"image": "gif", "turntable": 4},
    "columns": {"image": "sheet", "turntable": 4},
}
# The same of voxelizations alone: a grid has the channel that a file holds.
VOXELIZE_CONTEXT = {"channel": {"channels": ["color", "normal", "material", "label", "distance", "coverage"]}}
# Lists whose items depend on each other, or are names.
LISTS = {
    "blocks": [["concrete"], ["wool", "minecraft:stone", "stone", "red_concrete"]],
    "bounds": [[0, 0, 0, 1, 1, 1], [-1.5, 0, 0.25, 1e9, 1, 0.5]], "region": [[0, 0, 0, 1, 2, 16384]],
    "palette": [16, "cga16", "#1a1c2c,#f4f4f4"],
    "times": [[0], [0.5, 1, 86400]], "section": [[1, 0, 0, -0.5]],
    "transform": [[1, 0, 0, 0.5, 0, 0, -1, 1e9, 0, 1, 0, -3, 0, 0, 0, 1]],
}
# Options of names, of which the schema has the form alone.
OPEN = {"blocks", "palette"}
WRONG = [None, {}, [], [[1, 2, 3]], [None], "", "?", "1,", ",", ["?"], [1, 2], [1, "2", 3]]


# Settings that one value of an option needs instead.
VALUE_CONTEXT = {("layout", "atlas"): {"format": "slices"}}


def context_of(kind, name, value):
    if isinstance(value, str) and (name, value) in VALUE_CONTEXT:
        return VALUE_CONTEXT[name, value]
    return {**CONTEXT.get(name, {}), **(VOXELIZE_CONTEXT.get(name, {}) if kind == "voxelize" else {})}


def text_of(value):
    """The value as in a query string."""
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return ",".join(map(text_of, value)) if isinstance(value, list) else str(value)


class OpenApiOptions(DaemonTest):
    device = "cpu"

    @classmethod
    def setUpClass(cls):
        super().setUpClass()
        cls.chance = random.Random(16)
        cls.spec = cls.daemon.openapi.spec
        cls.schemas = cls.spec["components"]["schemas"]
        cls.asset = cls.daemon.upload(cls.fixtures / "sample.ply")
        worm = cls.daemon.upload(cls.fixtures / "worm.md5.zip")
        job = cls.daemon.submit(kind="voxelize", asset=worm, options={"size": 8, "frames": "0..1"})
        cls.sequence = cls.daemon.wait(job)["result"]["sequence"]
        cls.inputs = {"voxelize": {"asset": cls.asset}, "render": {"asset": cls.asset},
                      "export": {"sequence": cls.sequence}}

    def validator(self, name):
        return self.daemon.openapi.validator({"$ref": "#/components/schemas/" + name})

    def dry_run(self, kind, options):
        response = self.daemon.post("/v1/jobs?dry_run=1", {"kind": kind, **self.inputs[kind], "options": options})
        if response.status == 400:
            self.assertIn(response.json()["code"], ("invalid-option", "unknown-option"), response.body)
            return None
        self.assertEqual(response.status, 200, (options, response.body))
        return response.json()["options"]

    def right_values(self, name, schema):
        """Values that each alternative of the schema allows, in JSON's own types."""
        if name in LISTS:
            return list(LISTS[name])
        values = []
        for one in schema.get("anyOf", [schema]):
            if "enum" in one:
                values += one["enum"]
            elif one["type"] == "boolean":
                values += [True, False]
            elif one["type"] in ("integer", "number"):
                values += self.numbers(one)
            elif one["type"] == "array":
                count = self.chance.randint(one["minItems"], min(one.get("maxItems", 8), 16))
                item = one["items"]
                values.append([self.chance.choice(item["enum"]) if "enum" in item else self.numbers(item)[-1]
                               for _ in range(count)])
        return values

    def numbers(self, schema):
        low = schema.get("minimum", schema.get("exclusiveMinimum", -1000))
        high = schema.get("maximum", 1000)
        if schema["type"] == "integer":
            return [low, high, float(self.chance.randint(low, high)), self.chance.randint(low, high)]
        return [high, self.chance.uniform(low, high), self.chance.randint(int(low) + 1, int(high))]

    def wrong_values(self, schema):
        values = list(WRONG)
        for one in schema.get("anyOf", [schema]):
            if one.get("type") in ("integer", "number"):
                values += [one[key] + step for key, step in (("minimum", -1), ("maximum", 1)) if key in one]
            values += [[*("abc"[:n])] for n in (1, 3)] if one.get("type") == "array" else [True, 0.5]
        return values

    def test_a_schema_accepts_a_value_if_the_daemon_does(self):
        tried = {True: 0, False: 0}
        for kind in self.inputs:
            validator = self.validator(kind.capitalize() + "Options")
            for name, reference in self.schemas[kind.capitalize() + "Options"]["properties"].items():
                schema = self.schemas[reference["$ref"].rsplit("/", 1)[1]]
                right = self.right_values(name, schema)
                values = right + [text_of(value) for value in right] + self.wrong_values(schema)
                for number, value in enumerate(values):
                    options = {**context_of(kind, name, value), name: value}
                    if options.get("image") == "png":
                        del options["turntable"]
                    with self.subTest(kind=kind, options=options):
                        is_right = validator.is_valid(options)
                        tried[is_right] += 1
                        self.assertTrue(is_right or number >= len(right))
                        is_taken = self.dry_run(kind, options) is not None
                        self.assertTrue(is_right if is_taken else not is_right or name in OPEN)
                self.assertFalse(validator.is_valid({name + "x": 1}))
        self.assertGreater(min(tried.values()), 300, tried)

    def test_an_option_is_echoed_with_one_type_whatever_way_it_came_in(self):
        echoed = self.validator("EchoedOptions")
        for kind in self.inputs:
            for name, reference in self.schemas[kind.capitalize() + "Options"]["properties"].items():
                schema = self.schemas[reference["$ref"].rsplit("/", 1)[1]]
                for value in self.right_values(name, schema):
                    context = {} if value == "png" else context_of(kind, name, value)
                    with self.subTest(kind=kind, name=name, value=value):
                        typed = self.dry_run(kind, {**context, name: value})
                        self.assertEqual(typed, self.dry_run(kind, {**context, name: text_of(value)}))
                        echoed.validate(typed)
                        again = self.dry_run(kind, typed)
                        self.assertEqual(json.dumps(again), json.dumps(typed))

    def test_recorded_canonical_options_fit_the_schemas(self):
        echoed = self.validator("EchoedOptions")
        kinds = {"voxelize": "VoxelizeOptions", "render": "RenderOptions", "render-grid": "RenderOptions",
                 "export": "ExportOptions"}
        lines = (ROOT / "tests/unit/proto/options/canonical.txt").read_text().splitlines()
        for line in lines:
            options = json.loads(line.split("\t")[1])
            echoed.validate(options)
            self.validator(kinds[line.split(" ")[0]]).validate(options)
        self.assertGreater(len(lines), 40)


class OpenApiRoutes(DaemonTest):
    device = "cpu"

    def operations(self):
        for template, operations in self.daemon.openapi.spec["paths"].items():
            shared = operations.get("parameters", [])
            for method, operation in operations.items():
                if method != "parameters":
                    parameters = [self.daemon.openapi.resolve(one) for one in shared + operation.get("parameters", [])]
                    yield method.upper(), template, operation, {one["name"]: one for one in parameters
                                                                if one["in"] == "query"}

    def test_every_route_refuses_an_unknown_parameter_and_suggests_the_near_miss(self):
        for method, template, _, parameters in self.operations():
            path = template.replace("{id}", "x").replace("{index}", "0")
            misspelt = {"no_such_one": None, **{name + "x": name for name in parameters if len(name) > 2}}
            for wrong, right in misspelt.items():
                if wrong in parameters:
                    continue
                with self.subTest(method=method, path=path, parameter=wrong):
                    response = self.daemon.request(method, f"{path}?{urllib.parse.quote(wrong)}=1")
                    detail = self.assert_problem(response, 400, "unknown-option")["detail"]
                    near = re.fullmatch(f"unknown parameter '{wrong}'(?:; did you mean '(.+)'\\?)?", detail)
                    self.assertTrue(near, detail)
                    # Of "framex", the first of frame and frames.
                    self.assertEqual((near[1] or "")[:5], (right or "")[:5])

    def test_every_list_has_limit_after_and_next(self):
        lists = [one for one in self.operations() if one[2]["operationId"].startswith("list")]
        self.assertEqual(len(lists), 10)
        for method, template, operation, parameters in lists:
            with self.subTest(template):
                self.assertLessEqual({"limit", "after"}, set(parameters))
                schema = operation["responses"]["200"]["content"]["application/json"]["schema"]
                self.assertIn("next", self.daemon.openapi.resolve(schema)["properties"])


if __name__ == "__main__":
    unittest.main()
