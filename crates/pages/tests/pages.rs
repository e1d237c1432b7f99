//! Pages as a whole: what is in them, and what is not.

use geometry::shapes::Ball;
use geometry::{Grid, UpAxis, phase_field};
use pages::{
    Error, Facts, ImageElement, Page, Section, TableElement, View, figure, frames, markdown,
    paragraph, viewer,
};
use surfaces::{TriangleMesh, phase_field_surface};

const NASTY: &str = "</title></script><script>alert('1')</script>\" onload=\"x\" & <b>";

fn ball() -> TriangleMesh {
    let grid = Grid::<3>::centred(16, 1.0).unwrap();
    let eps = 2.0 * grid.spacing();
    let u = phase_field(grid, &Ball::new([0.0; 3], 0.3).unwrap(), eps).unwrap();
    phase_field_surface(&u, eps).unwrap()
}

fn picture() -> ImageElement {
    let picture = render::Picture::new([4, 3], vec![[1, 2, 3, 255]; 12]).unwrap();
    ImageElement::from_bytes("picture", &picture.to_png().unwrap()).unwrap()
}

/// A page with every kind of block, all with the same text.
fn page(text: &str) -> Page {
    let pictures = [(text.to_owned(), picture()), ("1".to_owned(), picture())];
    let ball = ball();
    let surfaces = [(text, &ball), ("1", &ball)];
    let inner = Section::new(text)
        .with(Facts::default().with(text, text))
        .with(paragraph(text))
        .with(markdown(text));
    Page::new(text).with_lead(text).with(
        Section::new(text)
            .with(paragraph(text))
            .with(figure(&picture(), text))
            .with(TableElement::new(text, [text, "b"], [[text, "2"]]).unwrap())
            .with(frames(text, &pictures))
            .with(viewer(text, &pictures[..1], View::default(), surfaces).unwrap())
            .with(inner),
    )
}

/// Everything between `<` and `>`, and values of `src` and `href`.
fn tags(html: &str) -> Vec<&str> {
    let body = &html[html.find("<body>").unwrap()..html.rfind("<script>").unwrap()];
    body.split('<')
        .skip(1)
        .map(|rest| rest.split_once('>').unwrap().0)
        .collect()
}

fn addresses(html: &str) -> Vec<&str> {
    ["src=\"", "href=\""]
        .into_iter()
        .flat_map(|name| html.split(name).skip(1))
        .map(|rest| rest.split_once('"').unwrap().0)
        .collect()
}

#[test]
fn text_is_never_markup() {
    let (plain, nasty) = (page("text").to_html(), page(NASTY).to_html());
    let names = |html: &str| -> Vec<String> {
        let name = |tag: &&str| tag.split([' ', '\n']).next().unwrap().to_owned();
        tags(html).iter().map(name).collect()
    };
    assert_eq!(names(&plain), names(&nasty));
    assert!(tags(&nasty).iter().all(|tag| !tag.contains(" onload=\"")));
    assert!(!nasty.contains(NASTY) && !nasty.contains("<script>alert"));
    assert!(nasty.contains("&lt;script&gt;alert('1')"));
}

#[test]
fn a_page_refers_to_nothing_elsewhere() {
    let html = page("text").to_html();
    let addresses = addresses(&html);
    assert_eq!(addresses.len(), 4);
    for address in addresses {
        assert!(address.starts_with("data:image/png;base64,"), "{address}");
    }
    for word in [
        "://",
        "//cdn",
        "@import",
        "url(",
        "fetch(",
        "XMLHttpRequest",
        "import(",
    ] {
        assert!(!html.contains(word), "{word}");
    }
    let policy = html
        .split("Content-Security-Policy\" content=\"")
        .nth(1)
        .unwrap();
    let policy = policy.split_once('"').unwrap().0;
    assert!(
        policy.starts_with("default-src 'none'; img-src data:;"),
        "{policy}"
    );
    assert!(!policy.contains("unsafe"), "{policy}");
}

#[test]
fn the_policy_allows_the_script_and_the_style_that_are_there() {
    use base64::Engine;
    use files::Sha256;
    let html = page("text").to_html();
    let inside = |from: &str, to: &str| {
        let start = html.rfind(from).unwrap() + from.len();
        html[start..].split_once(to).unwrap().0
    };
    for (directive, text) in [
        ("script-src", inside("<script>", "</script>")),
        ("style-src", inside("<style>", "</style>")),
    ] {
        let hash = base64::engine::general_purpose::STANDARD.encode(Sha256::of(text));
        assert!(html.contains(&format!("{directive} 'sha256-{hash}'")));
    }
}

#[test]
fn the_same_page_gives_the_same_bytes_and_only_what_it_needs() {
    let html = page("text").to_html();
    assert_eq!(html, page("text").to_html());
    assert!(html.contains("createShader") && html.contains("figure.frames"));
    let simple = Page::new("t")
        .with(Section::new("s").with(paragraph("p")))
        .to_html();
    assert!(!simple.contains("createShader") && !simple.contains("figure.frames"));
    // Four kilobytes of style, three of checks, and hardly anything else.
    assert!(simple.len() < 12_000, "{}", simple.len());
}

#[test]
fn sections_of_one_name_have_different_addresses() {
    let section = || Section::new("Same name");
    let page = Page::new("t")
        .with(section())
        .with(section())
        .with(section());
    let html = page.to_html();
    for id in ["same-name", "same-name-2", "same-name-3"] {
        assert_eq!(html.matches(&format!("<h2 id=\"{id}\">")).count(), 1);
        assert_eq!(html.matches(&format!("href=\"#{id}\"")).count(), 1);
    }
}

#[test]
fn pages_are_written_whole_or_an_error_names_them() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("p.html");
    page("text").write(&path).unwrap();
    assert_eq!(
        std::fs::read_to_string(&path).unwrap(),
        page("text").to_html()
    );
    let nowhere = folder.path().join("no/such/p.html");
    let message = page("text").write(nowhere).unwrap_err().to_string();
    assert!(
        message.contains("such") && !message.contains('\n'),
        "{message}"
    );
}

#[test]
fn viewers_turn_about_the_axis_that_points_up() {
    for up in UpAxis::ALL {
        let view = View {
            up,
            ..View::default()
        };
        let html = viewer(
            "ball",
            &[("0".to_owned(), picture())],
            view,
            [("0", &ball())],
        )
        .unwrap();
        assert!(html.0.contains(&format!("data-up=\"{}\"", up.index())));
    }
}

#[test]
fn views_that_cannot_be_are_refused() {
    let ball = ball();
    let view = View {
        elevation: 90.5,
        ..View::default()
    };
    let error = viewer("ball", &[("0".to_owned(), picture())], view, [("0", &ball)]).unwrap_err();
    assert!(matches!(error, Error::Render(_)), "{error}");
}
