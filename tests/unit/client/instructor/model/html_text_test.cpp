#include "client/instructor/model/html_text.h"

#include <gtest/gtest.h>

namespace needlelab {
namespace {

TEST(HtmlText, nothingOfItIsMarkup) {
  EXPECT_EQ(htmlText("<script>alert('a & \"b\"')</script>"),
            "&lt;script&gt;alert(&#39;a &amp; &quot;b&quot;&#39;)&lt;/script&gt;");
  EXPECT_EQ(htmlText("µm – ok"), "µm – ok");
  EXPECT_EQ(htmlText(std::string("a\0b\x1b", 4)), "a?b?");
  EXPECT_EQ(htmlText("\xff"), "?");
}

}  // namespace
}  // namespace needlelab
