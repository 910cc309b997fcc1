// A page whose charts stand above its tables.
#pragma once

#include <string>

#include "files/page_content.hpp"

namespace bms::reports {

/// As page_of() (report_page.hpp), the charts first.
std::string page_with_charts_first(const files::PageContent& content);

}  // namespace bms::reports
