"""Tests of what units render: parts that fit together on all workers, or are refused."""

from film import KDRAY, OPTIONS, ROOT, SPP, FilmCase, header_and_pixels, record, run


class Parts(FilmCase):
    def test_wrong_parts_are_refused(self):
        out = self.out()
        self.finish(out, "0")
        part = out / "parts/t2of4_b1of2.0000.exr"
        good = part.read_bytes()

        part.write_bytes(good[: len(good) // 2])
        self.do(out, "merge", "0", code=3, named="t2of4_b1of2.0000.exr")
        flipped = bytearray(good)
        flipped[-40] ^= 16
        part.write_bytes(flipped)
        self.do(out, "merge", "0", code=3, named="t2of4_b1of2.0000.exr")
        part.unlink()
        self.do(out, "merge", "0", code=3, named="the parts have gaps")
        # A scene that has changed between units.
        text = (ROOT / "scenes/cornell.toml").read_text()
        changed = self.out() / "cornell.toml"
        changed.write_text(text.replace("intensity = [", "intensity = [1", 1))
        self.assertNotEqual(changed.read_text(), text)
        # Its unit is refused. If it were not, its part would be.
        other = {"SCENE": self.packed(changed)}
        self.do(out, "render", "0", 2, 1, changed=other, code=2, named="SCENE is `cornell.kdpack ")
        (out / "film.txt").unlink()
        self.do(out, "render", "0", 2, 1, changed=other)
        (out / "film.txt").unlink()
        self.do(out, "merge", "0", code=3, named="scene_hash")
        part.write_bytes(good)
        self.do(out, "merge", "0")
        self.assertEqual((out / "0000.exr").read_bytes(), self.alone[0])

    def test_the_methods_that_workers_choose_change_no_pixel(self):
        """Workers may find other trees and traversals quicker than each other, so these must not change a bit."""
        methods = ["--traversal stack", "--traversal ropes", "--traversal mask", "--build fast", "--build best"]
        for integrator in ("path", "whitted"):
            wanted, records = None, set()
            for method in [*methods, "--accel grid2", "--primary auto" if integrator == "path" else "--primary trace"]:
                out, options = self.out(), f"--size 40x30 --cpu --threads 1 -q --integrator {integrator} {method}"
                self.do(out, "render", "0", 2, 1, changed={"BLOCKS": 1, "SPP": 2, "OPTIONS": options})
                part = out / "parts/t2of4_b1of1.0000.exr"
                pixels = header_and_pixels(part)[1]
                wanted = wanted or pixels
                self.assertEqual(pixels, wanted, method)
                records.add(record(part)["accel"])
            self.assertGreater(len(records), 4, "the methods were taken")

    def test_primary_rays_are_found_in_one_way_by_all_workers(self):
        alone = self.out() / "alone.exr"
        whitted = "--size 40x30 --integrator whitted --cpu --threads 1 -q"
        run(KDRAY, "render", self.pack, *whitted.split(), "-o", alone)
        self.assertTrue(record(alone)["whole"]["is_rasterized"], "the rule would rasterize so few triangles")
        for option, is_rasterized in (("", False), ("--primary auto", True), ("--primary=raster", True)):
            out = self.out()
            self.do(out, "render", "0", 1, 1, changed={"BLOCKS": 1, "SPP": 1, "OPTIONS": f"{whitted} {option}"})
            part = record(out / "parts/t1of4_b1of1.0000.exr")
            self.assertEqual(part["whole"]["is_rasterized"], is_rasterized, option)

    def test_parts_have_the_exposure_of_the_whole(self):
        scene = self.out() / "metered.toml"
        text = (ROOT / "scenes/cornell.toml").read_text()
        metered = text.replace("[render]", "[render]\nmetered = true", 1).replace("8.6, 8.0, 6.9", "860, 800, 690")
        scene.write_text(metered)
        out, pack = self.out(), self.packed(scene)
        self.finish(out, "0-1", changed={"SCENE": pack, "TILES": 2, "BLOCKS": 2})
        exposures = {record(part)["whole"]["exposure"] for part in [*out.glob("parts/*.exr"), *out.glob("*.exr")]}
        alone = self.out()
        options = [*OPTIONS.split(), "--spp", SPP, "--denoise", "off", "--frames", "0-1"]
        run(KDRAY, "render", pack, *options, "-o", alone / "####.exr")
        self.assertEqual(exposures, {record(alone / "0000.exr")["whole"]["exposure"]})
        self.assertNotEqual(exposures, {1.0})
        self.assertEqual((out / "0001.exr").read_bytes(), (alone / "0001.exr").read_bytes())

    def test_parts_of_several_devices_are_named(self):
        """Workers of two kinds: the CPU and a Vulkan driver."""
        out = self.out()
        changed = {"TILES": 2, "BLOCKS": 1, "OPTIONS": "--size 40x30 --integrator path --max-depth 3"}
        self.do(out, "render", "0", 1, 1, changed={**changed, "KDRAY": self.on_another_worker("--cpu")})
        self.do(out, "render", "0", 2, 1, changed=changed)
        self.do(out, "merge", "0", changed=changed, named="note: the parts come from several devices")
        self.assertIn("CPU; ", record(out / "0000.exr")["device"])

    def test_parts_of_several_versions_are_refused(self):
        out, changed = self.out(), {"TILES": 2, "BLOCKS": 1}
        self.do(out, "render", "0", 1, 1, changed=changed)
        self.do(out, "render", "0", 2, 1, changed=changed)
        self.do(out, "merge", "0", changed=changed)
        part = out / "parts/t2of2_b1of1.0000.exr"
        version = f'"version":"{record(part)["whole"]["version"]}"'
        other = version[:-2] + ("2" if version[-2] != "2" else "3") + '"'
        good = part.read_bytes()
        self.assertEqual(good.count(version.encode()), 1)
        part.write_bytes(good.replace(version.encode(), other.encode()))
        self.do(out, "merge", "0", changed=changed, code=3, named="has written it, and this is kdray")
