//! Pages, the page of results, and the documents of the repository.

mod documents;
mod pages;
mod results;
