"""Learned operators."""

import gc
import os

import numpy as np
import pytest
import willmore


@pytest.fixture(scope="module")
def network():
    told = []
    network = willmore.train_operator(2, 9, 2.0, quick=True, progress=lambda *what: told.append(what))
    assert told
    return network


def test_a_network_moves_as_mean_curvature(network):
    assert network.ratios == {"dimension": 2, "width": 9, "eps_over_h": 2.0, "step_over_h2": 1.0}
    assert network.kernel.shape == (9, 9)
    assert network.held_out_loss < 1e-5
    assert network.calibration["factors"]["metric"] == pytest.approx(1, abs=0.1)


def test_networks_are_files(network, tmp_path):
    path = tmp_path / "network.safetensors"
    network.save(path)
    read = willmore.Network.load(path)
    assert read.ratios == network.ratios and read.held_out_loss is None
    assert np.array_equal(read.kernel, network.kernel) and read.calibration == network.calibration
    for wrong in (tmp_path / "missing", tmp_path):
        with pytest.raises(willmore.Error):
            willmore.Network.load(wrong)
    (tmp_path / "text").write_text("text")
    with pytest.raises(willmore.Error):
        willmore.Network.load(tmp_path / "text")
    with pytest.raises(willmore.Error):
        network.save(tmp_path / "missing" / "network.safetensors")


def test_flows_take_a_network(network, tmp_path):
    network.save(tmp_path / "network.safetensors")
    flows = [
        willmore.flow("builtin:cross", cells=24, steps=3, network=one)
        for one in (network, tmp_path / "network.safetensors", str(tmp_path / "network.safetensors"))
    ]
    fields = [flow.run().field for flow in flows]
    assert np.array_equal(fields[0], fields[1]) and np.array_equal(fields[0], fields[2])
    usual = willmore.flow("builtin:cross", cells=24, steps=3).run()
    assert not np.array_equal(usual.field, fields[0])
    assert usual.report["energy"] == pytest.approx(flows[0].result().report["energy"], rel=0.2)
    with pytest.raises(willmore.Error, match="2D"):
        willmore.flow("builtin:cube", cells=24, steps=1, network=network)


def test_a_run_takes_a_file(network, tmp_path):
    with pytest.raises(willmore.Error, match="save the network"):
        willmore.Run.start("flow", "builtin:cross", tmp_path / "run", cells=24, steps=1, network=network)
    assert not (tmp_path / "run").exists()


def test_training_twice_gives_the_same_and_files_go_with_networks(network):
    first, network = network, willmore.train_operator(2, 9, 2.0, quick=True)
    assert np.array_equal(network.kernel, first.kernel)
    path = os.fspath(network)
    assert os.path.exists(path) and os.fspath(network) == path
    del network
    gc.collect()
    assert not os.path.exists(path)


def test_refused():
    for dimension, width, options in ((2, 8, {}), (4, 9, {}), (2, 9, {"device": "abacus"}), (2, 9, {"step_over_h2": -1})):
        with pytest.raises(willmore.Error):
            willmore.train_operator(dimension, width, 2.0, quick=True, **options)
