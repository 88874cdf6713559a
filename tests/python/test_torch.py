"""PyTorch: a model as a differentiable function, and the networks as modules."""

import numpy as np
import pytest
from conftest import SOURCE, sdmgen_program

import sdmgen

torch = pytest.importorskip("torch")
import sdmgen.torch as st  # noqa: E402

SHAPE = "shape: {name: ellipsoid}\ngrid: {size: [13, 12, 11], spacing: 0.9}\n"
STATISTICAL = SOURCE / "configs/statistical"
KINDS = {
    "f32": "network: {kind: pod, depth: 2, width: 16, rank: 8, modes: 16, degree: 2, weights: f32}\n",
    "f16": "network: {kind: pod, depth: 0, rank: 8, modes: 16, degree: 3, block: 3, weights: f16}\n",
    "i8": "network: {kind: pod, depth: 1, width: 13, rank: 9, modes: 16, degree: 2, block: 4, weights: i8}\n",
    "deepsdf": "network: {kind: deepsdf, depth: 3, width: 20}\n",
    "imnet": "network: {kind: imnet, depth: 3, width: 24}\n",
    "sdmnn": "network: {kind: sdmnn, depth: 2, channels: 3, width: 10}\n",
    "template": "network: {kind: template, modes: 16}\n",
    "template of parts": "shape: {name: linkage, options: {links: 2, motion: spatial}}\n"
    "grid: {size: [18, 24, 22], spacing: 0.6, centre: [1.5, 0, 0]}\nnetwork: {kind: template}\n",
    "template with a warp": f"shape: {{name: statistical, options: {{mean: {STATISTICAL}/mean.ply, modes: {STATISTICAL}/modes.npy, count: 2}}}}\n"
    "grid: {size: [22, 19, 18], spacing: 0.6}\nnetwork: {kind: template, modes: 8}\n",
}


@pytest.fixture(scope="session", params=KINDS)
def trained(request, tmp_path_factory):
    """A small network of each kind, hardly trained."""
    folder = tmp_path_factory.mktemp(request.param)
    data = "data: {static: 0, online: 0, start: 40, holdout: 4}\ntrain: {steps: 8, batch: 4}\n"
    shape = "" if "shape:" in KINDS[request.param] else SHAPE
    (folder / "c.yaml").write_text(shape + KINDS[request.param] + data)
    sdmgen_program("train", folder / "c.yaml", "--out", folder / "run", "--threads", 1)
    return folder / "run/model.sdm"


def params_of(model, n=3, seed=0):
    low, high = (np.array([getattr(p, end) for p in model.params]) for end in ("min", "max"))
    return low + np.random.default_rng(seed).uniform(0.1, 0.9, (n, len(low))) * (high - low)


def test_modules_are_the_networks_of_the_library(trained):
    model, network = sdmgen.Model(trained), st.load(trained)
    rows = params_of(model)
    maps = network(torch.from_numpy(rows)).numpy()
    # of integer weights the map of the derivatives is not rounded to integers of the coefficients
    expected = np.stack([model.jacobian(row).map.values for row in rows])
    assert maps.dtype == np.float32 and np.abs(maps - expected).max() < 2e-5 * np.abs(expected).max()
    assert np.abs(maps - model.batch(rows).values).max() < 5e-3 * np.abs(expected).max()
    # the derivatives, by automatic differentiation in double precision
    p = torch.from_numpy(rows[:1]).requires_grad_()
    w = np.random.default_rng(1).normal(size=model.grid.shape)
    (slope,) = torch.autograd.grad((network.double()(p) * torch.from_numpy(w)).sum(), p)
    back = model.vjp(w, rows[0])
    # the library takes the derivative of a template from its nodes, the module that of the interpolation
    limit = 5e-2 if model.kind == "template" else 2e-3
    assert np.abs(slope.numpy()[0] - back).max() < limit * np.abs(back).max() + 1e-3


def test_second_derivatives(trained):
    if sdmgen.Model(trained).kind != "pod":
        pytest.skip("piecewise linear activations")
    network = st.load(trained).double()
    p = torch.from_numpy(params_of(network.model, 1))
    h = torch.autograd.functional.hessian(lambda x: (network(x) ** 2).mean(), p)
    assert h.shape == (1, p.shape[1], 1, p.shape[1]) and torch.isfinite(h).all() and h.abs().max() > 0
    assert torch.autograd.gradgradcheck(lambda x: (network(x) ** 2).mean(), p.clone().requires_grad_())


def test_gradcheck_of_templates(trained):
    network = st.load(trained).double()
    if not isinstance(network, st.Template):
        pytest.skip("not a template")
    p = torch.from_numpy(params_of(network.model, 1)).requires_grad_()
    w = torch.from_numpy(np.random.default_rng(3).normal(size=network.model.grid.shape))
    assert torch.autograd.gradcheck(lambda x: (network(x) * w).sum((1, 2, 3)), p, eps=1e-7, atol=1e-2, rtol=1e-3)


def test_gradcheck(trained):
    model = sdmgen.Model(trained)
    if model.kind in ("deepsdf", "imnet", "sdmnn", "template"):
        pytest.skip("kinks of the activation or between the cells of a template")
    sdm = st.Sdm(model)
    p = torch.from_numpy(params_of(model, 2)).requires_grad_()
    w = torch.from_numpy(np.random.default_rng(2).normal(size=model.grid.shape))
    # the library computes in float: a step of 1e-2
    assert torch.autograd.gradcheck(lambda x: (sdm(x) * w).sum((1, 2, 3)), p, eps=1e-2, atol=0.3, rtol=2e-2)
    maps = sdm(p)
    assert maps.shape == (2, *model.grid.shape) and maps.dtype == torch.float64 and maps.requires_grad
    assert np.array_equal(sdm(p.detach()).numpy(), model.batch(p.detach().numpy()).values)
    single = sdm(p.detach().float())
    assert single.dtype == torch.float32 and not single.requires_grad


def test_mistakes(model):
    sdm = st.Sdm(model)
    with pytest.raises(ValueError, match=r"need a tensor \[n, 4\]"):
        sdm(torch.zeros(4))
    with pytest.raises(sdmgen.RangeError):
        sdm(torch.full((1, 4), 100.0))
    assert st.Sdm(model, policy="clamp")(torch.full((1, 4), 100.0)).shape == (1, *model.grid.shape)
    with pytest.raises(sdmgen.FormatError):
        st.load(SOURCE / "README.md")


@pytest.mark.parametrize("kind", ["adam", "lbfgs"])
def test_a_fit_to_a_map(model, kind):
    sdm, truth = st.Sdm(model), torch.tensor([[4.1, 0.5, 0.15, 0.1]], dtype=torch.float64)
    target = sdm(truth).detach()
    low = torch.tensor([p.min for p in model.params], dtype=torch.float64)
    size = torch.tensor([p.max - p.min for p in model.params], dtype=torch.float64)
    x = torch.zeros((1, 4), dtype=torch.float64, requires_grad=True)

    def loss():
        optimiser.zero_grad()
        value = ((sdm(low + size * x.sigmoid()) - target) ** 2).mean()
        value.backward()
        return value

    optimiser = torch.optim.Adam([x], lr=0.1) if kind == "adam" else torch.optim.LBFGS([x], max_iter=60, line_search_fn="strong_wolfe")
    first = float(loss())
    for _ in range(150 if kind == "adam" else 2):
        optimiser.step(loss)
    assert float(loss()) < 1e-2 * first
