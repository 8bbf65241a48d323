# Seeds: voxeld_make_fixtures DIR, then fuzz_gltf with DIR as its corpus.
voxeld_fuzzer(gltf gltf_scene.cpp voxeld_scene)
voxeld_fuzzer(image gltf_image.cpp voxeld_scene)
