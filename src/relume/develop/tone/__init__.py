"""What makes radiance of any range fit for a display: each operator a frozen value."""
