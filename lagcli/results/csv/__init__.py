"""Result files in CSV."""
