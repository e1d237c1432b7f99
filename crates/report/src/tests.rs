//! Whole figures: drawn, decoded and looked at.

use proptest::prelude::*;

use crate::axes::Axes;
use crate::colour::{INK, WHITE};
use crate::decoded::Picture;
use crate::{
    Axis, Colour, ColourMap, Curve, Error, Figure, Heatmap, Legend, LegendEntry, LineChart,
    LineStyle, Marker, OutputDir, Raster, Reference, Rgb, Series, Shapes,
};

const BLUE: Rgb = crate::OKABE_ITO[0];
const VERMILLION: Rgb = crate::OKABE_ITO[1];

/// The straight line from corner to corner of the plot.
fn diagonal() -> LineChart {
    LineChart::new(
        "Diagonal & more",
        Axis::linear("time t [s]").with_range(0.0, 1.0),
        Axis::linear("length <L>").with_range(0.0, 2.0),
    )
    .with_series(Series::new("straight", vec![[0.0, 0.0], [1.0, 2.0]]))
}

fn picture(figure: &Figure) -> Picture {
    Picture::new(&figure.to_png().unwrap())
}

/// The place of a point in the only panel of a figure, in layout units.
fn place(chart: &LineChart, at: [f64; 2]) -> (f64, f64) {
    let layout = Figure::from(chart.clone()).layout().unwrap();
    let plot = layout.plots[0];
    let fx = |axis: &Axis, value: f64| {
        let [low, high] = axis.range.unwrap();
        match axis.scale {
            crate::Scale::Linear => (value - low) / (high - low),
            crate::Scale::Log => (value / low).log10() / (high / low).log10(),
        }
    };
    (
        plot.x + fx(&chart.x, at[0]) * plot.width,
        plot.bottom() - fx(&chart.y, at[1]) * plot.height,
    )
}

#[test]
fn a_curve_is_where_its_points_are() {
    let chart = diagonal().with_legend(Legend::Hidden);
    let figure = Figure::from(chart.clone());
    let picture = picture(&figure);
    let layout = figure.layout().unwrap();
    assert_eq!(picture.width, 2 * layout.width as usize);
    assert_eq!(picture.height, 2 * layout.height as usize);
    assert_eq!(picture.pixel(0, 0), WHITE);
    for t in [0.1, 0.25, 0.5, 0.75, 0.9] {
        let (x, y) = place(&chart, [t, 2.0 * t]);
        assert!(picture.has_near(BLUE, x, y, 0.5), "nothing at {t}");
        let (x, y) = place(&chart, [t, 2.0 * (1.0 - t) + 0.3]);
        assert!(!picture.has_near(BLUE, x, y, 1.0), "something beside {t}");
    }
}

#[test]
fn a_power_law_is_straight_on_logarithmic_axes() {
    let points: Vec<[f64; 2]> = (0..=60)
        .map(|k| 10.0_f64.powf(-3.0 + f64::from(k) / 20.0))
        .map(|h| [h, h * h])
        .collect();
    let chart = LineChart::new(
        "",
        Axis::log("h").with_range(1e-3, 1.0),
        Axis::log("error").with_range(1e-6, 1.0),
    )
    .with_series(Series::new("", points));
    let picture = picture(&Figure::from(chart.clone()));
    let plot = Figure::from(chart).layout().unwrap().plots[0];
    for t in [0.2, 0.5, 0.8] {
        let (x, y) = (plot.x + t * plot.width, plot.bottom() - t * plot.height);
        assert!(picture.has_near(BLUE, x, y, 0.6), "not straight at {t}");
    }
}

#[test]
fn points_that_cannot_be_shown_interrupt_the_curve() {
    let points = vec![
        [0.1, 0.1],
        [0.4, 0.4],
        [0.5, f64::NAN],
        [0.6, 0.6],
        [0.9, 0.9],
    ];
    let chart = LineChart::new(
        "Gap",
        Axis::linear("x").with_range(0.0, 1.0),
        Axis::linear("y").with_range(0.0, 1.0),
    )
    .with_series(Series::new("", points));
    let picture = picture(&Figure::from(chart.clone()));
    let shown = |t: f64| {
        let (x, y) = place(&chart, [t, t]);
        picture.has_near(BLUE, x, y, 0.5)
    };
    assert!(shown(0.25) && shown(0.75) && !shown(0.5));
}

#[test]
fn nothing_to_draw_is_an_error_that_names_the_chart() {
    let empty = LineChart::new("Energy", Axis::linear("t"), Axis::log("W")).with_series(
        Series::new("bad", vec![[0.0, 0.0], [1.0, -1.0], [f64::NAN, 1.0]]),
    );
    let error = Figure::from(empty).to_svg().unwrap_err();
    assert!(matches!(&error, Error::Empty { chart } if chart == "Energy"));
    assert!(error.to_string().contains("Energy"));

    let grey = Heatmap::new("u", [2, 2], vec![f64::NAN; 4]);
    assert!(matches!(
        Figure::from(grey).to_png().unwrap_err(),
        Error::Empty { .. }
    ));
    let shapes = Figure::from(Shapes::new("none"));
    assert!(matches!(shapes.to_svg().unwrap_err(), Error::Empty { .. }));
    assert!(matches!(
        Figure::new("", 2).to_svg().unwrap_err(),
        Error::NoPanels
    ));
}

#[test]
fn sizes_and_shapes_that_do_not_fit_are_refused() {
    for (width, height) in [
        (10.0, 500.0),
        (800.0, 1e9),
        (f64::NAN, 500.0),
        (800.0, 90.0),
    ] {
        let error = Figure::from(diagonal())
            .with_size(width, height)
            .to_svg()
            .unwrap_err();
        assert!(
            matches!(error, Error::FigureSize { .. }),
            "{width} x {height}: {error}"
        );
    }
    let error = Figure::from(Heatmap::new("u", [3, 4], vec![0.0; 11]))
        .to_svg()
        .unwrap_err();
    assert!(matches!(
        error,
        Error::ArrayShape {
            expected: 12,
            found: 11,
            ..
        }
    ));
    let figure = Figure::from(diagonal()).with_size(700.0, 400.0);
    let layout = figure.layout().unwrap();
    assert!((layout.width - 700.0).abs() < 0.5 && (layout.height - 400.0).abs() <= 2.0);
}

#[test]
fn an_svg_holds_all_texts_and_no_nan() {
    let chart = diagonal()
        .with_series(Series::new(
            "broken",
            vec![[0.0, f64::NAN], [0.5, 0.1], [0.9, f64::INFINITY]],
        ))
        .with_reference(Reference::horizontal(0.5, "limit"))
        .with_reference(Reference::horizontal(99.0, "out of sight"))
        .with_note("A remark.");
    let svg = Figure::from(chart).to_svg().unwrap();
    for text in [
        "Diagonal &amp; more",
        "time t [s]",
        "length &lt;L&gt;",
        "straight",
        "broken",
        "limit",
        "A remark.",
        "0.5",
    ] {
        assert!(svg.contains(&format!(">\n{text}\n</text>")), "no {text:?}");
    }
    assert!(!svg.contains("NaN") && !svg.contains("inf") && !svg.contains("out of sight"));
    assert!(svg.contains("sans-serif") && svg.trim_end().ends_with("</svg>"));
}

#[test]
fn the_legend_shows_every_colour_and_covers_no_curve() {
    let falling = |scale: f64| -> Vec<[f64; 2]> {
        (0..=100)
            .map(|k| f64::from(k) / 50.0)
            .map(|t| [t, scale * (-t).exp()])
            .collect()
    };
    let chart = LineChart::new("Decay", Axis::linear("t"), Axis::linear("u"))
        .with_series(Series::new("one", falling(1.0)))
        .with_series(
            Series::new("two", falling(0.6))
                .with_colour(1)
                .with_style(LineStyle::Dashed),
        );
    let with = picture(&Figure::from(chart.clone()));
    let without = picture(&Figure::from(chart.clone().with_legend(Legend::Hidden)));
    assert_eq!(
        (with.width, with.height),
        (without.width, without.height),
        "legend is inside"
    );
    for colour in [BLUE, VERMILLION] {
        // The samples come on top of every pixel of the curves.
        assert!(with.count(colour) > without.count(colour) + 40);
    }
    for y in 0..with.height {
        for x in 0..with.width {
            if without.pixel(x, y) == BLUE {
                assert_eq!(with.pixel(x, y), BLUE, "curve covered at {x}, {y}");
            }
        }
    }
}

#[test]
fn a_legend_without_a_free_place_goes_below() {
    let mut full = LineChart::new(
        "Full",
        Axis::linear("x").with_range(0.0, 1.0),
        Axis::linear("y").with_range(0.0, 1.0),
    );
    for k in 0..30 {
        let y = (f64::from(k) + 0.5) / 30.0;
        let name = if k == 0 { "level" } else { "" };
        full = full.with_series(Series::new(name, vec![[0.0, y], [1.0, y]]));
    }
    let below = Figure::from(full.clone()).layout().unwrap();
    let hidden = Figure::from(full.with_legend(Legend::Hidden))
        .layout()
        .unwrap();
    let room = |layout: &crate::figure::Layout| layout.height - layout.plots[0].bottom();
    assert!(room(&below) > room(&hidden) + 15.0);
}

#[test]
fn own_legend_entries_replace_those_of_the_series() {
    let chart = diagonal()
        .with_entries([LegendEntry::line(
            "method A",
            Colour::Black,
            LineStyle::Dashed,
        )])
        .with_entries([LegendEntry::patch("N = 64", 0)]);
    let svg = Figure::from(chart).to_svg().unwrap();
    assert!(svg.contains("method A") && svg.contains("N = 64") && !svg.contains("straight"));
}

#[test]
fn markers_and_references_are_drawn() {
    let chart = LineChart::new(
        "Marks",
        Axis::linear("x").with_range(0.0, 1.0),
        Axis::linear("y").with_range(0.0, 1.0),
    )
    .with_series(
        Series::new("", vec![[0.25, 0.5], [0.75, 0.5]])
            .with_marker(Marker::Square)
            .with_style(LineStyle::None),
    )
    .with_reference(Reference::vertical(0.5, ""));
    let picture = picture(&Figure::from(chart.clone()));
    let (x, y) = place(&chart, [0.25, 0.5]);
    assert!(picture.has_near(BLUE, x + 2.5, y + 2.5, 0.3));
    let (x, y) = place(&chart, [0.4, 0.5]);
    assert!(
        !picture.has_near(BLUE, x, y, 2.0),
        "there is no line between the markers"
    );
    let (x, y) = place(&chart, [0.5, 0.5]);
    assert!(picture.has_near(crate::colour::GREY, x, y, 10.0));
}

#[test]
fn heat_map_cells_have_their_colours_and_orientation() {
    // Axis 0 goes right, axis 1 up: only the cell at x = last, y = first is hot.
    let mut values = vec![0.0; 12];
    values[3 * 3] = 1.0;
    let map = Heatmap::new("Hot cell", [4, 3], values)
        .with_axes(
            Axis::linear("x").with_range(0.0, 4.0),
            Axis::linear("y").with_range(0.0, 3.0),
        )
        .with_bar(Axis::linear("value"))
        .with_curve(
            Curve::new(vec![vec![[0.5, 0.5], [0.5, 2.5]]])
                .open()
                .with_colour(1)
                .with_width(4.0),
        );
    let figure = Figure::from(map);
    let (picture, plot) = (picture(&figure), figure.layout().unwrap().plots[0]);
    assert!(
        (plot.height / plot.width - 0.75).abs() < 0.01,
        "equal aspect"
    );
    let colour = |x: f64, y: f64| {
        let (px, py) = (
            plot.x + x / 4.0 * plot.width,
            plot.bottom() - y / 3.0 * plot.height,
        );
        picture.pixel((2.0 * px) as usize, (2.0 * py) as usize)
    };
    let (cold, hot) = (ColourMap::Viridis.at(0.0), ColourMap::Viridis.at(1.0));
    assert_eq!(colour(3.5, 0.5), hot);
    for (x, y) in [(0.2, 0.2), (3.5, 2.5), (0.2, 2.8), (2.5, 0.5)] {
        assert_eq!(colour(x, y), cold, "{x}, {y}");
    }
    assert_eq!(colour(0.5, 1.5), VERMILLION, "the curve on top");
    // Colours in between occur in the colour bar alone.
    let middle = ColourMap::Viridis.at(128.0 / 255.0);
    assert!(picture.has_near(middle, plot.right() + 17.0, plot.centre().y, 3.0));
    let svg = figure.to_svg().unwrap();
    assert_eq!(svg.matches("<image").count(), 2);
    assert!(svg.contains("value") && !svg.contains('\u{F8FF}'));
}

#[test]
fn signed_maps_are_white_at_zero() {
    let map = Heatmap::new("Signed", [3, 1], vec![-0.5, 0.0, 2.0])
        .with_axes(Axis::linear("x").with_range(0.0, 3.0), Axis::linear("y"))
        .with_map(ColourMap::BlueWhiteRed);
    let figure = Figure::from(map);
    let (picture, plot) = (picture(&figure), figure.layout().unwrap().plots[0]);
    let colour = |x: f64| {
        let px = plot.x + x / 3.0 * plot.width;
        picture.pixel((2.0 * px) as usize, (2.0 * plot.centre().y) as usize)
    };
    assert_eq!(colour(1.5), ColourMap::BlueWhiteRed.at(0.5));
    assert_eq!(colour(2.5), ColourMap::BlueWhiteRed.at(1.0));
    assert_eq!(colour(0.5), ColourMap::BlueWhiteRed.at(0.375));
}

fn square(half: f64) -> Vec<[f64; 2]> {
    vec![[-half, -half], [half, -half], [half, half], [-half, half]]
}

#[test]
fn shapes_are_filled_with_holes_at_a_common_scale() {
    let ring = Curve::new(vec![square(1.0), square(0.5)]).filled(Colour::Palette(1));
    let figure = Figure::new("Squares", 2)
        .with_panel(Shapes::new("ring").with_curve(ring))
        .with_panel(Shapes::new("small").with_curve(Curve::new(vec![square(0.5)])))
        .with_column_labels(["left", "right"])
        .with_row_labels(["only row\nsecond line"]);
    let (picture, layout) = (picture(&figure), figure.layout().unwrap());
    let (left, right) = (layout.plots[0], layout.plots[1]);
    assert!((left.width - left.height).abs() <= 1.0);
    assert!((left.y - right.y).abs() < 0.5 && (left.width - right.width).abs() <= 1.0);
    // The window is [-1.12, 1.12]: 6 per cent of the longest side more on each side.
    let unit = left.width / 2.24;
    let centre = left.centre();
    let filled = |x: f64, y: f64| {
        picture.has_near(VERMILLION, centre.x + x * unit, centre.y - y * unit, 0.5)
    };
    assert!(filled(0.75, 0.0) && filled(0.0, -0.75) && filled(0.9, 0.9));
    assert!(!filled(0.0, 0.0) && !filled(0.4, 0.4) && !filled(1.05, 0.0));
    let outline = Colour::Black.rgb();
    let at = right.centre();
    assert!(
        picture.has_near(outline, at.x + 0.5 * unit, at.y, 1.0),
        "the scale is common"
    );
    let svg = figure.to_svg().unwrap();
    for text in [
        "Squares",
        "left",
        "right",
        "only row",
        "second line",
        "ring",
        "small",
    ] {
        assert!(svg.contains(&format!(">\n{text}\n</text>")), "no {text:?}");
    }
}

#[test]
fn panels_line_up_and_share_one_legend() {
    let figure = Figure::new("Grid", 2)
        .with_panel(diagonal())
        .with_panel(diagonal())
        .with_panel(diagonal())
        .with_shared_legend();
    let layout = figure.layout().unwrap();
    let plots = &layout.plots;
    assert!(
        (plots[0].y - plots[1].y).abs() < 0.5 && (plots[0].height - plots[1].height).abs() < 0.5
    );
    assert!((plots[0].x - plots[2].x).abs() < 0.5 && plots[2].y > plots[0].bottom());
    assert!(plots[1].x > plots[0].right());
    assert!(plots[1].right() <= layout.width && plots[2].bottom() < layout.height);
    let svg = figure.to_svg().unwrap();
    assert_eq!(svg.matches(">\nstraight\n</text>").count(), 1);
}

#[test]
fn mixed_panels_can_be_drawn_and_written_twice_with_the_same_bytes() {
    let figure = Figure::new("Mixed", 3)
        .with_panel(diagonal())
        .with_panel(Heatmap::new("u", [2, 2], vec![1.0, 2.0, 3.0, 4.0]))
        .with_panel(Shapes::new("s").with_curve(Curve::new(vec![square(1.0)]).with_label("exact")));
    let root = tempfile::tempdir().unwrap();
    let folder = OutputDir::create(root.path()).unwrap();
    figure.write(&folder, "first").unwrap();
    figure.clone().write(&folder, "second").unwrap();
    for kind in ["svg", "png"] {
        let read = |stem: &str| std::fs::read(root.path().join(format!("{stem}.{kind}"))).unwrap();
        assert!(read("first") == read("second"), "{kind}");
    }
    let picture = Picture::new(&std::fs::read(root.path().join("first.png")).unwrap());
    assert!(picture.count(BLUE) > 50 && picture.count(ColourMap::Viridis.at(1.0)) > 50);
    assert!(picture.count(INK) > 50);
}

/// A picture of one colour whose left half is transparent.
fn half(columns: usize, rows: usize) -> Raster {
    let pixel = |k: usize| {
        if k % columns < columns / 2 {
            [9, 9, 9, 0]
        } else {
            [0, 158, 115, 255]
        }
    };
    Raster::new(
        [columns, rows],
        (0..columns * rows).map(pixel).collect::<Vec<_>>(),
    )
}

#[test]
fn pictures_keep_their_shape_and_show_the_page_where_they_are_transparent() {
    let green = crate::OKABE_ITO[2];
    for (columns, rows) in [(300, 200), (60, 40), (1500, 1000)] {
        let figure = Figure::new("Steps", 2)
            .with_panel(half(columns, rows).with_caption("step 100, w = 25.78"))
            .with_panel(half(columns, rows).with_title("above").with_frame());
        let (picture, layout) = (picture(&figure), figure.layout().unwrap());
        for plot in &layout.plots {
            assert!((plot.height / plot.width - 2.0 / 3.0).abs() < 0.01);
            let at = |x: f64, y: f64| {
                let (x, y) = (plot.x + x * plot.width, plot.y + y * plot.height);
                picture.pixel((2.0 * x) as usize, (2.0 * y) as usize)
            };
            for y in [0.02, 0.5, 0.98] {
                assert_eq!((at(0.02, y), at(0.45, y)), (WHITE, WHITE), "{columns} {y}");
                assert_eq!((at(0.55, y), at(0.98, y)), (green, green), "{columns} {y}");
            }
        }
        assert!(
            layout.plots[0].bottom() + 15.0 < layout.height,
            "room for the caption"
        );
        let svg = figure.to_svg().unwrap();
        assert_eq!(svg.matches("<image").count(), 2);
        assert!(!svg.contains("pixelated") && !svg.contains('\u{F8FF}'));
        for text in ["step 100, w = 25.78", "above"] {
            assert!(svg.contains(&format!(">\n{text}\n</text>")), "no {text:?}");
        }
    }
}

#[test]
fn pictures_of_the_right_size_are_copied_and_others_averaged_in_linear_light() {
    let noise = |k: usize| {
        [
            (k * 37 % 256) as u8,
            (k * 91 % 256) as u8,
            (k * 53 % 256) as u8,
            255,
        ]
    };
    let shown = |size: [usize; 2], pixels: Vec<[u8; 4]>| {
        let figure = Figure::from(Raster::new(size, pixels)).with_width(200.0);
        let plot = figure.layout().unwrap().plots[0];
        (picture(&figure), plot)
    };
    // The layout depends on the ratio of the sides alone.
    let (_, plot) = shown([1, 1], vec![[0; 4]]);
    let size = [2 * plot.width as usize, 2 * plot.height as usize];
    let (copied, _) = shown(size, (0..size[0] * size[1]).map(noise).collect());
    for (x, y) in [(0, 0), (7, 3), (size[0] - 1, size[1] - 1)] {
        let [r, g, b, _] = noise(y * size[0] + x);
        let at = (2 * plot.x as usize + x, 2 * plot.y as usize + y);
        assert_eq!(copied.pixel(at.0, at.1), Rgb(r, g, b), "{x} {y}");
    }
    // A fine chessboard of black and white has half the light of white.
    let double = [2 * size[0], 2 * size[1]];
    let board = (0..double[0] * double[1]).map(|k| {
        let v = 255 * ((k % double[0] + k / double[0]) % 2) as u8;
        [v, v, v, 255]
    });
    let (averaged, plot) = shown(double, board.collect());
    let centre = averaged.pixel(2 * plot.centre().x as usize, 2 * plot.centre().y as usize);
    assert!(centre.0.abs_diff(188) <= 1, "{centre:?}");
}

#[test]
fn pictures_without_pixels_or_with_the_wrong_number_are_refused() {
    let error = |raster: Raster| Figure::from(raster.with_caption("c")).to_png().unwrap_err();
    let none = error(Raster::new([0, 3], vec![]));
    assert!(matches!(none, Error::NoPixels { chart } if chart == "c"));
    let few = error(Raster::new([2, 2], vec![[0; 4]; 3]));
    assert!(matches!(
        few,
        Error::ArrayShape {
            expected: 4,
            found: 3,
            ..
        }
    ));
    let huge = error(Raster::new([usize::MAX, 2], vec![[0; 4]; 3]));
    assert!(matches!(huge, Error::ArrayShape { found: 3, .. }));
}

proptest! {
    #[test]
    fn any_data_gives_a_drawing_or_a_typed_error(
        points in prop::collection::vec([any::<f64>(), any::<f64>()], 0..20),
        scale in -320..300_i32,
        log_x in any::<bool>(),
        log_y in any::<bool>(),
    ) {
        let axis = |log: bool| if log { Axis::log("a") } else { Axis::linear("a") };
        // Numbers of all sizes, and numbers all of one size.
        let even: Vec<[f64; 2]> = points
            .iter()
            .map(|p| p.map(|c| 10.0_f64.powi(scale) * c.to_bits() as f64 / 1e19))
            .collect();
        for data in [points, even] {
            let loops = Curve::new(vec![data.clone()]).filled(0);
            let chart = LineChart::new("Any", axis(log_x), axis(log_y))
                .with_series(Series::new("any", data).with_style(LineStyle::Dashed));
            let shapes = Shapes::new("Any").with_curve(loops);
            for figure in [Figure::from(chart), Figure::from(shapes)] {
                match figure.with_size(400.0, 300.0).to_svg() {
                    Ok(svg) => prop_assert!(!svg.contains("NaN") && !svg.contains("inf")),
                    Err(error) => prop_assert!(
                        matches!(error, Error::Empty { .. } | Error::Range { .. }),
                        "{error}"
                    ),
                }
            }
        }
    }
}

/// The mapping used for drawing is the one the tests above assume.
#[test]
fn charts_resolve_their_axes() {
    let context = Figure::from(diagonal()).layout().unwrap();
    assert!(context.plots[0].width > 500.0);
    let plot = context.plots[0];
    let figure_context = crate::panel::Context {
        fonts: crate::style::Fonts::for_columns(1),
        cell_width: 700.0,
        shared_legend: false,
        window: None,
    };
    let chart = diagonal();
    let axes: Axes<'_> = chart.axes(&figure_context).unwrap();
    let middle = axes.place(&plot, [0.5, 1.0]);
    assert!(middle.distance(plot.centre()) < 1e-9);
}
