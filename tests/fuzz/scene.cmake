foreach(format obj off ply stl zip md5)
  voxeld_fuzzer(scene_${format} scene_${format}.cpp voxeld_scene)
endforeach()
