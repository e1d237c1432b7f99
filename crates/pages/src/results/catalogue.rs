//! What the experiments are, in the paper's order.

/// An experiment and the figures that it must have.
pub(crate) struct Entry {
    /// Name of its folder.
    pub folder: &'static str,
    /// Heading.
    pub title: &'static str,
    /// What it is, in a sentence or two.
    pub description: &'static str,
    /// Names of figures without extension, with their captions.
    pub figures: &'static [(&'static str, &'static str)],
}

/// The entry of a folder.
pub(crate) fn entry(folder: &str) -> Option<&'static Entry> {
    CATALOGUE.iter().find(|entry| entry.folder == folder)
}

const CIRCLES: &[(&str, &str)] = &[
    (
        "convergence",
        "Mean L² error over the circles against time, mean curvature flow and Willmore flow.",
    ),
    (
        "error_over_radius",
        "Error at the end against the initial radius.",
    ),
    (
        "work_per_step",
        "Hessian-vector products and Newton steps for each step of Willmore flow, mean over the circles.",
    ),
    COST,
];

const COST: (&str, &str) = (
    "error_over_cost",
    "Error of Willmore flow at the end against the time that a circle takes.",
);

const PLANE: &[(&str, &str)] = &[
    (
        "shapes",
        "The curve at the times that the paper shows; orange: the reference.",
    ),
    ("errors", "L² distance to the reference against time."),
];

/// All experiments whose results are committed; others are shown after them.
pub(crate) const CATALOGUE: &[Entry] = &[
    Entry {
        folder: "learned_networks",
        title: "Learned networks",
        description: "Kernels, activations and transfer functions of the trained mean curvature \
                      operators V[u] = F(K∗u), and how well they fit.",
        figures: &[
            (
                "learned_networks",
                "Kernels and activations beside those of a splitting scheme.",
            ),
            (
                "radial_symmetry",
                "Entries of the kernels against their distance from the centre.",
            ),
            ("transfer", "Transfer functions of the kernels."),
        ],
    },
    Entry {
        folder: "circle_convergence",
        title: "Flows of circles",
        description: "Mean curvature flow and Willmore flow of 30 circles against the exact \
                      solutions, by the hybrid scheme and by finite elements.",
        figures: CIRCLES,
    },
    Entry {
        folder: "circle_cost",
        title: "Accuracy against cost",
        description: "Not in the paper: what Willmore flow of circles costs by every method and scheme, n = 64 \
                      to 512, and how accurate it is.",
        figures: &[COST],
    },
    Entry {
        folder: "mcf_cross",
        title: "Mean curvature flow of a cross",
        description: "A cross that is not convex under mean curvature flow, against finite \
                      elements on a finer grid with smaller steps.",
        figures: PLANE,
    },
    Entry {
        folder: "rectangle",
        title: "Willmore flow of a rectangle",
        description: "All methods against nested implicit finite elements on a finer grid.",
        figures: PLANE,
    },
    Entry {
        folder: "cross",
        title: "Willmore flow of a cross",
        description: "All methods against nested implicit finite elements on a finer grid.",
        figures: PLANE,
    },
    Entry {
        folder: "ellipse_orders",
        title: "Orders of convergence",
        description: "Not in the paper: Willmore flow of an ellipse with the grid spacing and the time step halved again and again.",
        figures: &[(
            "orders",
            "L² distances at t = 2⁻¹⁰ between successive runs, and to the finest run.",
        )],
    },
    Entry {
        folder: "timing_tables",
        title: "Computing time",
        description: "128 Willmore steps of the cross by every method, which take turns on one \
                      machine, and one step of the armadillo.",
        figures: &[(
            "timing",
            "Wall time against cells per unit length, beside the paper's on other machines.",
        )],
    },
    Entry {
        folder: "disk_and_cube",
        title: "Cube and thick disk",
        description: "Willmore flow of two solids by the hybrid scheme beside nested finite \
                      elements.",
        figures: &[(
            "surfaces",
            "The surfaces at steps 0, 1 and 100, with their Willmore energies.",
        )],
    },
    Entry {
        folder: "armadillo",
        title: "Armadillo",
        description: "Willmore flow of a scanned figure, with time steps that double.",
        figures: &[(
            "surfaces",
            "From the scanned figure to a nearly round sphere.",
        )],
    },
    Entry {
        folder: "rocker_arm",
        title: "Rocker arm",
        description: "Willmore flow of a machine part of genus one, and the Clifford torus next \
                      to where it ends.",
        figures: &[(
            "surfaces",
            "The part, the first and the last step, and the nearest Clifford torus.",
        )],
    },
    Entry {
        folder: "spheres",
        title: "Spheres",
        description: "Not in the paper: the network for surfaces on spheres, their mean curvature \
                      flow, their energies, and whether they stand still under Willmore flow.",
        figures: &[(
            "spheres",
            "Errors of mean curvature flow, and the Willmore energy, against the radius.",
        )],
    },
    Entry {
        folder: "calibration",
        title: "Calibration",
        description: "Not in the paper: by which factors the scheme differs from Willmore flow \
                      with each network, predicted and measured.",
        figures: &[
            (
                "discs",
                "Willmore energy of discs over that of the exact circle, against the radius.",
            ),
            (
                "diagnostics",
                "Displacement errors, spectra and second derivatives of the operators.",
            ),
        ],
    },
    Entry {
        folder: "circle_elements",
        title: "Flows of circles, finite elements",
        description: "All finite-element methods at n = 128 and 256 beside the paper's hybrid scheme, by an \
                      earlier version of the solver.",
        figures: &[(
            "convergence",
            "Mean L² error over the circles against time.",
        )],
    },
    Entry {
        folder: "inpainting_2d",
        title: "Inpainting",
        description: "Willmore flow of what lies inside the green frame; everything else is held.",
        figures: &[
            ("disk_frames", "A disk whose corner was cut out."),
            ("cross_frames", "A cross whose middle is smoothed."),
            ("energies", "Willmore energy against time."),
        ],
    },
    Entry {
        folder: "inpainting_3d",
        title: "Inpainting of surfaces",
        description: "Willmore flow of what lies inside the green box; everything else is held.",
        figures: &[
            ("ball_frames", "A ball whose corner was cut out."),
            ("tubes_frames", "Six tubes that are blended."),
            ("energies", "Willmore energy against time."),
        ],
    },
    Entry {
        folder: "performance",
        title: "Performance",
        description: "Not in the paper: what a step of the hybrid scheme costs in two and three \
                      dimensions, and where the time goes.",
        figures: &[(
            "performance",
            "Time of a step, its products, and its parts.",
        )],
    },
    Entry {
        folder: "train_networks",
        title: "Training",
        description: "How the shipped networks were trained, by Levenberg-Marquardt and, for \
                      comparison, by the paper's Adam.",
        figures: &[(
            "learning_curves",
            "Losses on training data and on data held out.",
        )],
    },
];

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;

    #[test]
    fn every_experiment_is_there_once() {
        let folders: HashSet<&str> = CATALOGUE.iter().map(|entry| entry.folder).collect();
        assert_eq!(folders.len(), CATALOGUE.len());
        assert_eq!(
            entry("cross").map(|e| e.title),
            Some("Willmore flow of a cross")
        );
        assert!(entry("crosses").is_none());
    }
}
