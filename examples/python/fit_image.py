"""Fits a torus to a test image of it, and shows the contour over the image.

    python3 fit_image.py [fit_image.png]
"""

import sys

import sdmgen

shape = sdmgen.Shape("torus")
truth = {"major": 2.6, "minor": 0.9}
made = sdmgen.phantom(shape, truth, pose=sdmgen.random_pose(20, 0.5, seed=3), spacing=0.35, seed=7)
result = sdmgen.fit(shape, made.image, rotation=(0, 0, 0), spacing=0.35, reference=made.label)
for i, name in enumerate(truth):
    print(f"{name}: {result.params[i]:.3f} +- {result.sd[i]:.3f} mm, truth {truth[name]}")
print(f"Dice {result.dice:.3f}; translation {result.pose.translation.round(2)}, truth {made.pose.translation.round(2)}")

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

sdm, k = result.map(made.image.grid), made.image.shape[0] // 2
plt.imshow(made.image.values[k], origin="lower", cmap="gray")
plt.contour(sdm.values[k], [0], colors="r")
plt.contour(made.label.values[k], [0.5], colors="y", linestyles=":")
plt.title("fit (red) and truth (yellow)")
plt.savefig(sys.argv[1] if len(sys.argv) > 1 else "fit_image.png")
