"""What is evaluated, and how."""
