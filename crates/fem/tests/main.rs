//! Steps and the nested scheme.

mod nested;
mod steps;
