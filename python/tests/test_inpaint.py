"""Regions that are filled."""

import numpy as np
import pytest
import willmore
from conftest import circle_field


@pytest.fixture(scope="module")
def hole(square):
    mask = np.zeros_like(square)
    mask[24:34, 12:34] = True
    return mask


def test_a_damaged_mask_is_completed(square, hole):
    damaged = square & ~hole
    before = damaged.copy()
    result = willmore.inpaint(damaged, hole, ansatz="full", cells=48, steps=3)
    image = result.image
    assert image.dtype == np.bool_ and np.array_equal(image[~hole], damaged[~hole])
    assert np.array_equal(damaged, before)
    # The region was full at the beginning, and loses its corners first.
    assert image[24:32, 22].all() and 0.5 * hole.sum() < image[hole].sum() < 0.9 * hole.sum()
    assert not image[33, 12] and not image[33, 33]
    later = willmore.inpaint(damaged, hole, ansatz="full", cells=48, steps=10)
    assert later.report["energy"] < 0.5 * result.report["energy"] and later.image[hole].sum() < image[hole].sum()
    empty = willmore.inpaint(damaged, hole, ansatz="empty", cells=48, steps=2).image
    assert empty[hole].sum() < image[hole].sum() and np.array_equal(empty[~hole], damaged[~hole])


@pytest.mark.parametrize("ink, paper", [(255, 0), ([200, 30, 20], [255, 250, 255]), ([0, 0, 200, 255], [0, 0, 0, 0])])
def test_images_stay_outside_of_the_mask(square, hole, ink, paper):
    image = np.where(square if np.ndim(ink) == 0 else square[:, :, None], np.array(ink, np.uint8), np.array(paper, np.uint8))
    result = willmore.inpaint(image, hole, ansatz="empty", cells=48, steps=3).image
    assert result.dtype == np.uint8 and result.shape == image.shape
    assert np.array_equal(result[~hole], image[~hole])
    assert not np.array_equal(result[hole], image[hole])
    # What is empty has the colour of the paper.
    assert np.array_equal(result[32, 14], np.array(paper))


def test_fields_stay_outside_of_the_mask_bit_for_bit():
    field, nodes = circle_field()
    mask = np.zeros(field.shape, bool)
    mask[30:44, 16:32] = True
    result = willmore.inpaint(field, mask, ansatz="empty", spacing=0.1, origin=(5, 7), steps=8)
    assert np.array_equal(result.field[~mask], field[~mask])
    assert np.abs(result.field - field)[mask].max() > 0.1
    assert result.spacing == pytest.approx(0.1) and result.origin == pytest.approx([5, 7])
    # The same region by its name changes nodes in it and no others.
    result = willmore.inpaint(field, "box:8,8.6,9.4,10.2", spacing=0.1, origin=(5, 7), steps=3)
    x, y = nodes[:, result.field != field]
    assert len(x) and x.min() > 7.9 and x.max() < 9.5 and y.min() > 8.5 and y.max() < 10.3


@pytest.mark.parametrize("dimension, options", [(2, {}), (2, {"box_side": 1.5}), (3, {})])
def test_a_mask_marks_the_nodes_of_a_field_in_a_file(dimension, options, tmp_path):
    side = options.get("box_side", {2: 2.0, 3: 1.0}[dimension])
    cells = 48 if dimension == 2 else 24
    nodes = np.mgrid[(slice(cells),) * dimension] * side / cells - side / 2
    # Larger along the first axis, and the mask is on one side of it.
    radius = np.linalg.norm(nodes / np.reshape([1.3, 1.0, 1.0][:dimension], (dimension,) + (1,) * dimension), axis=0)
    field = np.tanh((0.25 * side - radius) / (np.sqrt(2) * 2 * side / cells))
    mask = np.zeros(field.shape, bool)
    mask[(slice(3 * cells // 5, 4 * cells // 5),) + (slice(cells // 3, 3 * cells // 5),) * (dimension - 1)] = True
    np.save(tmp_path / "field.npy", field)
    of_array = willmore.inpaint(field, mask, ansatz="empty", spacing=side / cells, origin=-side / 2, steps=2)
    of_file = willmore.inpaint(tmp_path / "field.npy", mask, ansatz="empty", steps=2, **options)
    assert np.array_equal(of_file.field, of_array.field)
    assert np.array_equal(of_file.field[~mask], field[~mask]) and (of_file.field[mask] != field[mask]).mean() > 0.9
    run = willmore.Run.start("inpaint", tmp_path / "field.npy", tmp_path / "run", mask=mask, ansatz="empty", steps=2, **options)
    assert np.array_equal(run.field, of_array.field)


def test_a_mask_of_a_file_has_the_shape_of_its_field(square, tmp_path):
    np.save(tmp_path / "field.npy", circle_field()[0])
    with pytest.raises(willmore.Error, match=r"\(48, 40\).*that of the field, \(48, 48\)"):
        willmore.inpaint(tmp_path / "field.npy", square)
    # An array of 0 and 1 in space is a volume of voxels, which has no nodes.
    np.save(tmp_path / "voxels.npy", np.pad(np.ones((4, 4, 4)), 2))
    with pytest.raises(willmore.Error, match="region such as"):
        willmore.inpaint(tmp_path / "voxels.npy", np.pad(np.ones((2, 2, 2), bool), 3))


def test_large_fields_stay_outside_of_the_mask_bit_for_bit():
    field, _ = circle_field(cells=128)
    mask = np.zeros(field.shape, bool)
    mask[70:80, 60:70] = True
    result = willmore.inpaint(field, mask, ansatz="empty", spacing=0.1, origin=(5, 7), steps=2)
    assert np.array_equal(result.field[~mask], field[~mask])


def test_a_field_in_space():
    x, y, z = np.mgrid[:24, :24, :24] * 0.2
    field = np.tanh((1.4 - np.sqrt((x - 2.4) ** 2 + (y - 2.4) ** 2 + (z - 2.4) ** 2)) / (np.sqrt(2) * 0.4))
    mask = np.zeros(field.shape, bool)
    mask[15:22, 8:17, 8:17] = True
    result = willmore.inpaint(field, mask, ansatz="full", spacing=0.2, steps=2)
    assert np.array_equal(result.field[~mask], field[~mask])
    assert result.field[mask].mean() > field[mask].mean() + 0.1
    assert isinstance(result.mesh, willmore.Arrays) and result.image is None


def test_a_region_of_an_image_is_in_pixels_from_the_lower_left(square):
    result = willmore.inpaint(square, "box:4,8,20,30", ansatz="empty", cells=48, steps=2).image
    changed = np.argwhere(result != square)
    # Columns from 4 to 20, rows from the lower side up.
    assert len(changed) and changed[:, 1].min() >= 4 and changed[:, 1].max() < 20
    assert changed[:, 0].min() >= 48 - 30 and changed[:, 0].max() < 48 - 8


@pytest.mark.parametrize(
    "mask, says",
    [
        (np.ones((5, 5), bool), "everywhere"),
        (np.zeros((48, 40), bool), "nowhere"),
        (np.ones((48, 40), np.uint8), "array of bool"),
        (np.eye(48, 30, dtype=bool), "48 x 40|40 x 48"),
        (np.eye(4, dtype=bool)[None], "region"),
        (None, "array of bool"),
        ("bix:1,2", "bix"),
        ("box:1,2", "box:1,2"),
    ],
)
def test_refused_masks(square, mask, says):
    with pytest.raises(willmore.Error, match=says):
        willmore.inpaint(square, mask, cells=48, steps=1)


def test_refused_options(square, hole):
    with pytest.raises(willmore.Error, match="ansatz"):
        willmore.inpaint(square, hole, ansatz="half")
    with pytest.raises(willmore.Error, match="shape of the field|shape"):
        willmore.inpaint(circle_field()[0], hole)
    with pytest.raises(willmore.Error, match="`maks`"):
        willmore.inpaint(square, hole, maks=1)
