//! Files by other programs.

/// A file with this header, whose length has four bytes from format 2 on.
pub fn npy(format: u8, header: &str, data: &[u8]) -> Vec<u8> {
    let length = (header.len() as u32).to_le_bytes();
    let length = if format == 1 { &length[..2] } else { &length };
    let magic = &b"\x93NUMPY"[..];
    [magic, &[format, 0], length, header.as_bytes(), data].concat()
}

/// Bytes as NumPy writes them: `data` in the given order, of the given type.
pub fn foreign(dtype: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
    let order = if fortran { "True" } else { "False" };
    let text = format!("{{'descr': '{dtype}', 'fortran_order': {order}, 'shape': {shape}, }}");
    npy(1, &format!("{text:<117}\n"), data)
}

pub fn doubles(shape: &str, values: &[f64]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    foreign("<f8", false, shape, &data)
}
