gen_input.o: tests/support/gen_input.c tests/support/gen_input.h \
  trainer/capture/read/capture_load.h trainer/capture/views/capture.h \
  trainer/basics/error.h trainer/basics/checkpoint.h \
  trainer/basics/file.h trainer/basics/output.h \
  trainer/exchange/cloud_files.h trainer/exchange/cloud.h \
  trainer/exchange/cloud_facts.h trainer/exchange/harmonics.h \
  trainer/capture/loaders/colmap.h trainer/capture/views/remap.h \
  trainer/exchange/film_sound.h tests/support/gen_cloud.h \
  tests/support/gen_mutate.h tests/support/gen_stream.h \
  common/container.h common/model.h common/memory_bank.h common/mlp.h \
  common/mlp_layer.h common/cpu.h common/symbols.h decoder/saga.h \
  trainer/measure/layout.h trainer/capture/files/npy.h \
  trainer/capture/files/picture.h trainer/capture/files/ply.h \
  trainer/exchange/splice.h trainer/capture/files/toml.h \
  trainer/train/run/train.h trainer/train/plan/base_choice.h \
  trainer/train/plan/options.h trainer/train/plan/ablation.h \
  trainer/splat/splat.h trainer/splat/attributes.h trainer/basics/real.h \
  trainer/basics/threads.h trainer/splat/canvas.h trainer/code/encode.h \
  trainer/code/cost.h common/prob.h common/fx.h common/scaffold.h \
  common/nets.h common/tally.h trainer/train/pack/quality.h \
  trainer/rig/pictures.h trainer/rig/cube.h trainer/basics/rng.h \
  trainer/scene/scene.h trainer/nn/net.h trainer/code/suffix.h \
  trainer/scene/twin.h trainer/basics/arena.h trainer/basics/alloc.h \
  trainer/scene/links.h common/interp.h trainer/code/quantise.h \
  trainer/train/plan/tool_choice.h trainer/train/plan/scene_model.h \
  trainer/train/plan/policy.h

tests/support/gen_input.h:

trainer/capture/read/capture_load.h:

trainer/capture/views/capture.h:

trainer/basics/error.h:

trainer/basics/checkpoint.h:

trainer/basics/file.h:

trainer/basics/output.h:

trainer/exchange/cloud_files.h:

trainer/exchange/cloud.h:

trainer/exchange/cloud_facts.h:

trainer/exchange/harmonics.h:

trainer/capture/loaders/colmap.h:

trainer/capture/views/remap.h:

trainer/exchange/film_sound.h:

tests/support/gen_cloud.h:

tests/support/gen_mutate.h:

tests/support/gen_stream.h:

common/container.h:

common/model.h:

common/memory_bank.h:

common/mlp.h:

common/mlp_layer.h:

common/cpu.h:

common/symbols.h:

decoder/saga.h:

trainer/measure/layout.h:

trainer/capture/files/npy.h:

trainer/capture/files/picture.h:

trainer/capture/files/ply.h:

trainer/exchange/splice.h:

trainer/capture/files/toml.h:

trainer/train/run/train.h:

trainer/train/plan/base_choice.h:

trainer/train/plan/options.h:

trainer/train/plan/ablation.h:

trainer/splat/splat.h:

trainer/splat/attributes.h:

trainer/basics/real.h:

trainer/basics/threads.h:

trainer/splat/canvas.h:

trainer/code/encode.h:

trainer/code/cost.h:

common/prob.h:

common/fx.h:

common/scaffold.h:

common/nets.h:

common/tally.h:

trainer/train/pack/quality.h:

trainer/rig/pictures.h:

trainer/rig/cube.h:

trainer/basics/rng.h:

trainer/scene/scene.h:

trainer/nn/net.h:

trainer/code/suffix.h:

trainer/scene/twin.h:

trainer/basics/arena.h:

trainer/basics/alloc.h:

trainer/scene/links.h:

common/interp.h:

trainer/code/quantise.h:

trainer/train/plan/tool_choice.h:

trainer/train/plan/scene_model.h:

trainer/train/plan/policy.h:
