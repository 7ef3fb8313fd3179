"""What people look at: videos, pages, plans and previews."""
