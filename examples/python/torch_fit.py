"""Fits parameters to a target map through PyTorch, by Adam and by L-BFGS.

    python3 torch_fit.py MODEL [torch_fit.png]
"""

import sys

import torch

import sdmgen
import sdmgen.torch

model = sdmgen.Model(sys.argv[1])
sdm = sdmgen.torch.Sdm(model)
low = torch.tensor([p.min for p in model.params], dtype=torch.float64)
size = torch.tensor([p.max - p.min for p in model.params], dtype=torch.float64)
truth = low + size * torch.linspace(0.3, 0.7, len(low), dtype=torch.float64)
target = sdm(truth[None])
curves = {}


def fit(name, make, steps):
    """Minimises the mean square difference of the maps; a sigmoid keeps the parameters in range."""
    x = torch.zeros((1, len(low)), dtype=torch.float64, requires_grad=True)
    optimiser, losses = make([x]), []

    def loss():
        optimiser.zero_grad()
        value = ((sdm(low + size * x.sigmoid()) - target) ** 2).mean()
        value.backward()
        losses.append(float(value))
        return value

    for _ in range(steps):
        optimiser.step(loss)
    found = (low + size * x.sigmoid()).detach()[0]
    error = ((found - truth) / size).abs().max()
    print(f"{name}: {len(losses)} maps, root mean square difference {losses[-1] ** 0.5:.2g} mm, "
          f"parameters off by {100 * error:.2g} % of their ranges")  # fmt: skip
    curves[name] = losses


fit("Adam", lambda x: torch.optim.Adam(x, lr=0.1), 150)
fit("L-BFGS", lambda x: torch.optim.LBFGS(x, max_iter=60, line_search_fn="strong_wolfe"), 1)

try:
    import matplotlib
except ImportError:
    sys.exit("no picture: matplotlib is not installed")
matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

for name, losses in curves.items():
    plt.semilogy(losses, label=name)
plt.xlabel("maps")
plt.ylabel("mean square difference, mm^2")
plt.legend()
plt.savefig(sys.argv[2] if len(sys.argv) > 2 else "torch_fit.png")
