//! Steps and the nested scheme.

mod measured;
mod nested;
mod steps;
