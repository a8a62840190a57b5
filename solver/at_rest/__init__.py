"""The beam before contact, and what is fixed in the image: learned from the rest images.

`rest_state.learn_rest_state` learns a `RestState` once per rig, from the images that agree
(`agreement`). Its parts, and what each frame uses them for:

- `extract` measures the beam's centreline (`tracker`);
- `line`, a `RestLine` fitted to `rest_points`, has the clamp's pose, the bow of the beam, and the
  `pattern` of its dirt: they are subtracted along the `bent_line` of a frame (`to_measurement`);
- `landmarks` measure a shift of the image since (`tracker`);
- `tip` is compared with the tip of a bent beam (`antenna`, `to_measurement`);
- `noise` and the numbers of images that were left out are reported (`lab`).
"""
