foreach(format binvox npy nrrd vox)
  voxeld_fuzzer(volume_${format} volume_${format}.cpp voxeld_volumes)
endforeach()
