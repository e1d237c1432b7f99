//! Which page of a stack is where.

/// Sections along z, channels and times, the pages of which follow each other in this order: the first axis fastest.
pub struct Planes {
    axes: [(char, u64); 3],
}

impl Planes {
    /// Positive numbers of Z, C and T in some order, if it is one.
    pub fn new(axes: &[(char, u64)]) -> Option<Self> {
        let axes: [(char, u64); 3] = axes.try_into().ok()?;
        let mut names = axes.map(|(name, _)| name);
        names.sort_unstable();
        (names == ['C', 'T', 'Z']).then_some(Self { axes })
    }

    /// All pages.
    pub fn count(&self) -> u64 {
        self.sections().saturating_mul(self.volumes())
    }

    /// Sections of a volume.
    pub fn sections(&self) -> u64 {
        self.product(|name| name == 'Z')
    }

    /// Channels at all times.
    pub fn volumes(&self) -> u64 {
        self.product(|name| name != 'Z')
    }

    fn product(&self, is_meant: impl Fn(char) -> bool) -> u64 {
        let axes = self.axes.iter().filter(|(name, _)| is_meant(*name));
        axes.fold(1, |all, (_, count)| all.saturating_mul(*count))
    }

    /// The page of a section, a channel and a time, if they are there.
    pub fn page(&self, [z, c, t]: [u64; 3]) -> Option<u64> {
        let (mut page, mut stride) = (0_u64, 1_u64);
        for (name, count) in self.axes {
            let index = match name {
                'Z' => z,
                'C' => c,
                _ => t,
            };
            if index >= count {
                return None;
            }
            page = page.checked_add(stride.checked_mul(index)?)?;
            stride = stride.checked_mul(count)?;
        }
        Some(page)
    }

    /// The number of the volume of a page: channels and times in the order of their pages.
    pub fn frame(&self, page: u64) -> u64 {
        let (mut rest, mut frame, mut stride) = (page, 0, 1_u64);
        for (name, count) in self.axes {
            if name != 'Z' {
                frame += stride.saturating_mul(rest % count);
                stride = stride.saturating_mul(count);
            }
            rest /= count;
        }
        frame
    }
}
