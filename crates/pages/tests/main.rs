//! Pages, and the page of results.

mod pages;
mod results;
